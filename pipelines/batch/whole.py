"""The batch as a whole: plan, run, and tell of it; the same inputs leave the same bytes, however often it was cut."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.errors import BadInputError, UsageError

from .crew import Crew
from .job import Job, Outcome
from .journal import NAME, Journal, journal
from .one import failure, fit_one
from .photograph import Photograph
from .plan import Item, Options, plan
from .run import Work, run

Ended = Callable[[Item, Outcome], None]


@dataclass(slots=True, kw_only=True)
class Ending:
    """How all fits ended, in their order; `kept` came from an earlier run."""

    items: list[Item]
    outcomes: list[Outcome]
    flags: list[str] = field(default_factory=list)

    @property
    def counts(self) -> Counter[str]:
        """How many were done, kept and failed."""
        return Counter(outcome.status for outcome in self.outcomes)


def batch(
    photographs: Sequence[Photograph],
    options: Options,
    crew: Crew,
    *,
    ended: Ended,
    note: Callable[[str], None],
    work: Work = fit_one,
) -> Ending:
    """Fit all photographs and write the batch's files; `ended` is told of each as it ends, `note` of what is odd.

    Raises UsageError where the folder cannot be used, or holds results of other settings or of another version.
    """
    from .finish import finish

    items = plan(photographs, options)
    _folder(options)
    outcomes: dict[int, Outcome] = {}
    with journal(options.out, version=options.version, resume=options.resume) as book:
        _sweep(options.out)
        _refuse_other_settings(items, book)
        jobs = list(_jobs(items, options, book, outcomes, ended))

        def over(job: Job, outcome: Outcome) -> None:
            item = items[job.number]
            if job.before is None or (outcome.status != "kept" and outcome.input):  # else the old line stays true
                book.ended(item.place, item.digest, outcome)
            outcomes[job.number] = outcome
            ended(item, outcome)

        if jobs:
            run(jobs, crew, work, ended=over, note=note)
            _sweep(options.out)
        ending = Ending(items=items, outcomes=[outcomes[number] for number in range(len(items))])
        finish(ending, options)
    return ending


def _folder(options: Options) -> None:
    out = options.out
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file; expected a folder for the results: --out DIR")
    begun = (out / NAME).exists()
    if out.is_dir() and any(out.iterdir()) and not options.overwrite and not (options.resume and begun):
        told = "holds a batch" if begun else "is not empty"
        more = ", --resume to go on with it, or --overwrite" if begun else ", or --overwrite to write into it"
        raise UsageError(f"{out} {told}; expected a new folder: --out DIR{more}")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write to {out}: {error.strerror}; choose another folder with --out") from error


def _sweep(out: Path) -> None:
    """Remove what a killed run, or a worker that died, left half made; nothing of the kind belongs to another batch
    that is running, for this one holds the lock.
    """
    for draft in list(out.rglob(".fit-material-*.part")):
        if draft.is_dir() and not draft.is_symlink():
            shutil.rmtree(draft, ignore_errors=True)


def _refuse_other_settings(items: Sequence[Item], book: Journal) -> None:
    other = [
        item for item in items if (known := book.before.get(item.place)) and _other(known, item) and known.get("result")
    ]
    if other:
        raise UsageError(
            f"the results of {len(other)} photographs, {other[0].place} the first, are of other settings or outputs; "
            "expected the same flags, scene files, cards and charts, or --overwrite"
        )


def _other(known: Mapping[str, Any] | None, item: Item) -> bool:
    return bool(known and known.get("settings") and item.digest and known["settings"] != item.digest)


def _jobs(
    items: Sequence[Item], options: Options, book: Journal, outcomes: dict[int, Outcome], ended: Ended
) -> Iterator[Job]:
    """What is to be done; items without settings have failed already."""
    for number, item in enumerate(items):
        if not item.settings:
            outcomes[number] = failure(number, item.error or BadInputError("no settings"))
            book.ended(item.place, "", outcomes[number])
            ended(item, outcomes[number])
            continue
        known = book.before.get(item.place)
        yield Job(
            number=number,
            asked=tuple((one.path.absolute(), own) for one, own in zip(item.photographs, item.settings, strict=True)),
            out=options.out.absolute(),
            place=item.place,
            page=options.page,
            exports=options.exports,
            version=options.version,
            resume=options.resume,
            before=None if _other(known, item) else known,  # what failed by other settings is tried anew
            beacon=None,
        )
