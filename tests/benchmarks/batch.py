"""What a batch costs beyond the fits themselves, and what a second core gives.

python -m tests.benchmarks.batch     prints the figures; `make bench` calls `main()`

The photograph that ships with the project, as often as asked, with the default preset; every fit is whole, with its
page. One after another in this process, warm; as a batch of two workers, their start-up and the batch's page counted;
as a batch of one worker, a third as many: its processor time beyond that of a batch of a single photograph is what each
further photograph costs.
"""

from __future__ import annotations

import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipelines.batch.crew import Crew, loky_processes
from pipelines.batch.one import fit_one
from tests.batch import shoots

DEMO = Path(__file__).resolve().parents[2] / "docs" / "demo"
COUNT = 24
THROUGHPUT, OVERHEAD = 1.8, 0.05


def shoot(folder: Path, count: int) -> Path:
    """The demo's photograph and sidecar under `count` names."""
    folder.mkdir()
    for number in range(count):
        for suffix in (".dng", ".dng.toml"):
            shutil.copy(DEMO / f"demo{suffix}", folder / f"ball{number:03d}{suffix}")
    return folder


def seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Wall-clock seconds, and processor seconds of this process and those it started and saw end."""
    begin, used = time.perf_counter(), _used_s()
    work()
    return time.perf_counter() - begin, _used_s() - used


def _used_s() -> float:
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in both)


def settings_for(one: Any) -> Any:
    """The photograph's sidecar over the defaults."""
    from pipelines.layers import resolve

    return resolve(one.path)


def plainly(source: Path, out: Path) -> None:
    """One photograph after another in this process, as a loop in a script would."""
    from threadpoolctl import threadpool_limits

    from pipelines.batch.inputs import photographs
    from pipelines.fit_material import fit_material
    from pipelines.report.write import write_outputs

    with threadpool_limits(1):
        for one in photographs([str(source)]):
            settings = settings_for(one)
            report = fit_material(one.path, settings, processes=1)
            write_outputs(report, out / f"{one.path.stem}.fit", settings)


def batched(source: Path, out: Path, workers: int) -> None:
    crew = Crew(workers=workers, engage=loky_processes)
    shoots.run(source, out, crew, work=fit_one, settings_for=settings_for, page=True)


def measure(count: int = COUNT) -> dict[str, tuple[float, float]]:
    """Wall and processor seconds of each way."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        warm, source = shoot(folder / "warm", 1), shoot(folder / "shoot", count)
        third = shoot(folder / "third", max(count // 3, 2))
        plainly(warm, folder / "warm.out")
        return {
            "plain": seconds(lambda: plainly(source, folder / "plain")),
            "single": seconds(lambda: batched(warm, folder / "single", 1)),
            "third": seconds(lambda: batched(third, folder / "one", 1)),
            "two": seconds(lambda: batched(source, folder / "two", 2)),
        }


def main(count: int = COUNT) -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    taken = measure(count)
    for name, (wall, used) in taken.items():
        sys.stdout.write(f"{name:8}{wall:8.1f} s wall{used:8.1f} s processor\n")
    throughput = taken["plain"][0] / taken["two"][0]
    each = (taken["third"][1] - taken["single"][1]) / (max(count // 3, 2) - 1)
    overhead = each / (taken["plain"][1] / count) - 1
    rows = [
        _row("batch on two cores, x one process", throughput, THROUGHPUT, throughput >= THROUGHPUT),
        _row(
            "batch: processor time of a photograph beyond its fit and files, share",
            overhead,
            OVERHEAD,
            overhead <= OVERHEAD,
        ),
    ]
    sys.stdout.writelines(f"{row['name']}: {row['figure']:.3f}, target {row['target']}\n" for row in rows)
    return rows


def _row(name: str, figure: float, target: float, met: bool) -> dict[str, Any]:
    return {"name": name, "figure": figure, "target": target, "met": met}


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT)
