"""All trials side by side; what is finished stays finished."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from typing import Any

from pipelines.batch.crew import loky_processes
from toolkit.errors import FitMaterialError

from .design import Trial
from .record import opened
from .trial import run_trial

Ended = Callable[[Mapping[str, Any]], None]
KEPT = "failed"  # sub-folder of the photographs whose fit failed or missed


def run(
    trials: Sequence[Trial], folder: Path, *, workers: int, resume: bool, discrepancy: bool, ended: Ended
) -> list[Mapping[str, Any]]:
    """The lines of all trials in their order; `ended` is told of each as it ends, of those kept from before first.

    Raises UsageError where `folder` holds a record of other trials, FitMaterialError where a worker dies.
    """
    photographs = folder / KEPT
    photographs.mkdir(parents=True, exist_ok=True)
    if not resume:
        _forget(photographs)
    with opened(folder, trials, resume=resume, discrepancy=discrepancy) as record:
        lines = {line["number"]: line for line in record.before}
        for line in lines.values():
            ended(line)
        waiting = [trial for trial in trials if trial.number not in lines]
        if waiting:
            work = partial(run_trial, folder=photographs, discrepancy=discrepancy)
            for line in _done(waiting, work, min(workers, len(waiting))):
                record.add(line)
                lines[line["number"]] = line
                ended(line)
    if not any(photographs.iterdir()):
        photographs.rmdir()
    return [lines[trial.number] for trial in trials]


def _forget(photographs: Path) -> None:
    """Remove what an earlier run kept."""
    for path in photographs.glob("trial-*"):
        path.unlink()


def _done(waiting: Sequence[Trial], work: Callable[[Trial], dict[str, Any]], workers: int) -> Iterator[dict[str, Any]]:
    """Lines as they come."""
    try:
        with loky_processes(workers) as pool:
            for future in as_completed([pool.submit(work, trial) for trial in waiting]):
                yield future.result()
    except BrokenProcessPool as error:
        raise FitMaterialError(
            "a worker died; expected more memory, or fewer --jobs; --resume keeps what is done"
        ) from error
