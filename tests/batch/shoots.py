"""Folders of photographs that are a few bytes each, and batches of them with the fit faked."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.batch.crew import Crew
from pipelines.batch.inputs import photographs
from pipelines.batch.job import Job, Outcome
from pipelines.batch.plan import Options
from pipelines.batch.whole import Ending, batch
from pipelines.settings import Settings

from . import fake

VERSION = "1.2.3"


def shoot(folder: Path, count: int, *, bad: tuple[int, ...] = ()) -> Path:
    """`count` photographs in two folders; those numbered in `bad` cannot be fitted."""
    for number in range(count):
        place = folder / f"day{number % 2 + 1}" / f"ball{number:03d}.dng"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(f"{'bad' if number in bad else 'good'} {number}".encode())
    return folder


class Inline(Executor):
    """An executor in this very process: any will do."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextmanager
def inline(_workers: int) -> Iterator[Executor]:
    yield Inline()


INLINE = Crew(workers=1, engage=inline, restless=False)


def run(
    source: Path,
    out: Path,
    crew: Crew = INLINE,
    *,
    material: str = "paint",
    work: Callable[[Job], Outcome] = fake.work,
    ended: Callable[..., None] = lambda item, outcome: None,
    notes: list[str] | None = None,
    **options: Any,
) -> Ending:
    """A batch of all photographs in `source`."""
    found = [replace(one, material=material) for one in photographs([str(source)], leave_out=out)]
    chosen = Options(out=out, **{"settings_for": lambda one: Settings(), "page": False, "version": VERSION, **options})
    return batch(found, chosen, crew, ended=ended, note=(notes if notes is not None else []).append, work=work)


def digests(out: Path) -> dict[str, str]:
    """Every file below `out` that is to be the same however often the batch was cut."""
    return {
        str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not path.name.endswith(".run.json") and path.name != "batch.journal.jsonl"
    }
