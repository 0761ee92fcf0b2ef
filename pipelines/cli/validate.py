"""`fit-material validate`: can the numbers be trusted? Renders of known truth through the very pipeline."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from toolkit.errors import UsageError

from .flags import OUTPUT, RUN, SCENE, TalkFlags
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.validate.design import Trial

BAD = 1
RENDERS_OF_A_SETUP = 64


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ValidateFlags:
    """What is rendered, and where the page goes."""

    scene: Annotated[
        Path | None,
        Parameter(group=SCENE, metavar="FILE", help="Your own set-up, as for `render`, in place of the designed set."),
    ] = None
    renders: Annotated[int | None, Parameter(group=SCENE, metavar="N", help="Renders of the set-up. [default: 64]")] = (
        None
    )
    seed: Annotated[int, Parameter(group=RUN, metavar="N", help="Same seed, same renders. [default: 0]")] = 0
    discrepancy: Annotated[Literal["on", "off"], Parameter(group=RUN, help="As for a fit. [default: on]")] = "on"
    out: Annotated[
        Path | None,
        Parameter(
            group=OUTPUT, metavar="DIR", help="Folder of page, tables and record. [default: ./validation-PRESET]"
        ),
    ] = None
    json: Annotated[bool, Parameter(group=OUTPUT, help="Print the outcome as one JSON object.")] = False
    against: Annotated[
        Path | None,
        Parameter(
            group=OUTPUT, metavar="FILE", help="An earlier validation.json: exit 1 on a real change for the worse."
        ),
    ] = None
    jobs: Annotated[int | None, Parameter(group=RUN, metavar="N", help="Processes. [default: one a core]")] = None
    resume: Annotated[bool, Parameter(group=RUN, help="Go on with what is there: do what is missing.")] = False
    overwrite: Annotated[bool, Parameter(group=RUN, help="Begin anew in a folder that is there.")] = False


def validate(
    preset: Annotated[
        Literal["quick", "standard", "full"],
        Parameter(help="How much: 112, 1050 or 5250 clean renders, and broken ones. [default: quick]"),
    ] = "quick",
    /,
    *,
    what: ValidateFlags = ValidateFlags(),  # frozen
    talk: TalkFlags = TalkFlags(),  # noqa: B008  # frozen
) -> int:
    """Render balls of known truth, fit them as any photograph, and say whether the numbers can be trusted.

    Exit code 1 where they cannot. Example, before a photograph is taken: fit-material validate --scene my.toml
    """
    _refuse(what)
    terminal = Terminal(json=what.json, quiet=talk.quiet, verbose=talk.verbose and not talk.quiet, debug=talk.debug)
    name = what.scene.stem if what.scene is not None else preset
    out = what.out or Path(f"validation-{name}")
    _refuse_existing(out, what)
    before = _record(what.against)
    trials = _trials(preset, what)
    begin = time.monotonic()
    lines = _run(trials, out, what, terminal)
    return _tell(trials, lines, out, what, before, time.monotonic() - begin, name, terminal)


def _refuse(what: ValidateFlags) -> None:
    if what.overwrite and what.resume:
        raise UsageError("--overwrite and --resume contradict each other; expected one of them")
    if what.renders is not None and what.scene is None:
        raise UsageError("--renders is for --scene; expected a preset alone: quick, standard or full")
    for flag, value, least in (("--jobs", what.jobs, 1), ("--renders", what.renders, 8)):
        if value is not None and value < least:
            raise UsageError(f"{flag}: found {value}; expected {least} or more")


def _refuse_existing(out: Path, what: ValidateFlags) -> None:
    from pipelines.validate.record import NAME

    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file; expected a folder: --out DIR")
    if (out / NAME).exists() and not (what.resume or what.overwrite):
        raise UsageError(f"{out / NAME} exists; expected another --out, or --resume, or --overwrite")


def _record(path: Path | None) -> Mapping[str, Any] | None:
    from pipelines.validate.outcome import read_record

    return None if path is None else read_record(path)


def _trials(preset: Literal["quick", "standard", "full"], what: ValidateFlags) -> tuple[Trial, ...]:
    if what.scene is None:
        from pipelines.validate.design import designed

        return designed(preset, seed=what.seed)
    from pipelines.layers import resolve
    from pipelines.validate.setup import repeated

    return repeated(resolve(scene=what.scene), what.renders or RENDERS_OF_A_SETUP, seed=what.seed)


def _run(trials: Sequence[Trial], out: Path, what: ValidateFlags, terminal: Terminal) -> list[Mapping[str, Any]]:
    from pipelines.batch.crew import cores
    from pipelines.validate.run import run

    from .progress import watching

    with watching(len(trials), terminal) as watch:

        def ended(line: Mapping[str, Any]) -> None:
            watch.ended(f"trial {line['number']}", line["status"], line.get("reason", ""))

        return run(
            trials,
            out,
            workers=what.jobs or cores(),
            resume=what.resume,
            discrepancy=what.discrepancy == "on",
            ended=ended,
        )


def _tell(
    trials: Sequence[Trial],
    lines: Sequence[Mapping[str, Any]],
    out: Path,
    what: ValidateFlags,
    before: Mapping[str, Any] | None,
    seconds: float,
    name: str,
    terminal: Terminal,
) -> int:
    """Write page, table and record; print the verdict; the exit code."""
    from pipelines.report.result import result_text
    from pipelines.validate.outcome import outcome, table, worse
    from pipelines.validate.page import page_text
    from pipelines.validate.score import score
    from pipelines.validate.verdict import verdict
    from pipelines.validate.words import scene_sentence, told

    found = score(lines)
    result = outcome(found, seconds=seconds, trials=name)
    changed = worse(result, before) if before is not None else []
    promise = "" if what.scene is None else scene_sentence(found)
    page = page_text(found, lines, title=f"Validation: {name}", told=told(trials), promise=promise)
    (out / "validation.html").write_text(page, encoding="utf-8")
    (out / "validation.csv").write_text(table(lines), encoding="utf-8")
    (out / "validation.json").write_text(result_text(result, indent=1), encoding="utf-8")
    if what.json:
        terminal.object(result)
    else:
        said = [promise] if promise else []
        terminal.result("\n".join([*said, verdict(found), f"page: {out / 'validation.html'}"]) + "\n")
    for change in changed:
        terminal.error(f"worse than {what.against}: {change}")
    return 0 if result["good"] and not changed else BAD
