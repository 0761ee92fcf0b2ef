"""What a real series costs a photograph, and how soon a page of a thousand is there.

python -m tests.benchmarks.series    prints the figures; `make bench` calls `main()`

48 photographs of a glossy ball by one command on two workers (skipped without the real data). A thousand photographs
with the fit faked: memory of the parent; opening and sorting in Chromium (skipped without it), with the layout that
follows.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli import main as fit_material
from tests.batch import series
from tests.batch.conftest import planned
from tests.batch.test_many import many
from tests.browser.devtools import tab

MOST_S, MOST_MIB, OPENS_S, SORTS_S = 4.0, 300.0, 2.0, 0.2
WORKERS = 2
SORTED = """(() => {
  const buttons = Array.from(document.querySelectorAll('#all thead button')), times = [];
  for (const button of [...buttons, ...buttons]) {
    const begin = performance.now();
    button.click();
    document.body.offsetHeight;  // the layout that follows
    times.push(performance.now() - begin);
  }
  return times;
})()"""


def a_photograph_s(folder: Path) -> float:
    """Wall-clock seconds of the whole command over the number of photographs."""
    listed = str(series.manifest(folder / "ball.toml"))
    begin = time.perf_counter()
    code = fit_material(
        ["batch", listed, "--preset", "quick", "--jobs", str(WORKERS), "--out", str(folder / "series"), "-q"]
    )
    assert code in (0, 4)
    return (time.perf_counter() - begin) / series.COUNT


def page_s(page: Path, folder: Path) -> tuple[float, float]:
    """Seconds until the page is there, and of the slowest column's sort: best of three visits, of two directions."""
    opened, sorting = [], []
    for _ in range(3):
        with tab(page, folder) as shown:
            opened.append(shown.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd"))
            times = shown.evaluate(SORTED)
            half = len(times) // 2
            sorting.append([min(pair) for pair in zip(times[:half], times[half:], strict=True)])
            assert shown.told == []
    return min(opened) / 1000, max(min(column) for column in zip(*sorting, strict=True)) / 1000


def main() -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for measure in (_series, _thousand):
            try:
                rows += measure(folder)
            except pytest.skip.Exception as missing:
                sys.stdout.write(f"skipped: {missing}\n")
    sys.stdout.writelines(f"{row['name']}: {row['figure']:.3f}, target {row['target']}\n" for row in rows)
    return rows


def _series(folder: Path) -> list[dict[str, Any]]:
    return [_row(f"48 photographs of one material: s a photograph, {WORKERS} workers", a_photograph_s(folder), MOST_S)]


def _thousand(folder: Path) -> list[dict[str, Any]]:
    with planned(folder / "plan"):
        peak = many(folder, 1000)
    opens, sorts = page_s(folder / "out" / "batch.html", folder)
    return [
        _row("1,000 photographs: the parent's peak, MiB", peak, MOST_MIB),
        _row("page of 1,000 photographs: opens, s", opens, OPENS_S),
        _row("page of 1,000 photographs: slowest sort, s", sorts, SORTS_S),
    ]


def _row(name: str, figure: float, target: float) -> dict[str, Any]:
    return {"name": name, "figure": figure, "target": target, "met": figure <= target}


if __name__ == "__main__":
    main()
