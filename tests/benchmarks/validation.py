"""What a validation gains from all cores over one process.

python -m tests.benchmarks.validation     prints the figures; `make bench` calls `main()`

The preset `quick`, whole: one trial after another in this process, warm; then as the command runs it, a worker a core,
their start-up and the record on the disk counted.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from pipelines.batch.crew import cores
from pipelines.validate.design import Trial, designed
from pipelines.validate.run import run
from pipelines.validate.trial import run_trial

SHARE = 0.9  # of as many processes as there are cores


def main() -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    trials, workers = designed("quick"), cores()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _plainly(trials[:1], folder)
        plain = _seconds(lambda: _plainly(trials, folder))
        crew = _seconds(lambda: _by(workers, trials, folder))
    gain = plain / crew
    for label, seconds in (("one process", plain), (f"{workers} workers", crew)):
        sys.stdout.write(f"validate quick, {len(trials)} trials, {label}: {seconds:.1f} s\n")
    name = f"validate on {workers} cores, x one process"
    sys.stdout.write(f"{name}: {gain:.3f}, target {SHARE * workers:g}\n")
    return [{"name": name, "figure": gain, "target": SHARE * workers, "met": gain >= SHARE * workers}]


def _plainly(trials: tuple[Trial, ...], folder: Path) -> None:
    with threadpool_limits(1):
        for trial in trials:
            run_trial(trial, folder)


def _by(workers: int, trials: tuple[Trial, ...], folder: Path) -> None:
    run(trials, folder, workers=workers, resume=False, discrepancy=True, ended=lambda _: None)


def _seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


if __name__ == "__main__":
    main()
