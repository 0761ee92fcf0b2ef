"""What decoding in a process of its own costs, above decoding within this one.

python -m tests.benchmarks.isolation     prints the figures; `make bench` calls `main()`

A 24-megapixel mosaic as DNG, read three ways in turn: apart, by a fork of the prepared process; first, with that
process to be started; within. What differs in one turn is one measurement, so that a machine that is busy for a while
is so for all. What a caller waits for is counted: the child's start, its imports where it has any, the pixels handed
over and the digest, to the record in hand.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.io import good
from toolkit.io import prepared
from toolkit.io.read import read, read_in_process

HEIGHT, WIDTH = 4000, 6000
TURNS = 15
MOST_S = {"": 0.05, ", the first file": 0.2}  # per 24 megapixels


def photograph(folder: Path) -> Path:
    """A large mosaic of the small picture's statistics."""
    small = good.mosaic()
    tiles = -(-HEIGHT // small.shape[0]), -(-WIDTH // small.shape[1])
    return good.dng(folder / "large.dng", np.tile(small, tiles)[:HEIGHT, :WIDTH])


def seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def measure(turns: int = TURNS) -> list[tuple[float, float, float]]:
    """Seconds apart, first and within, turn by turn, the page cache and this process's imports warm."""
    with tempfile.TemporaryDirectory() as name:
        path = photograph(Path(name))

        def turn() -> tuple[float, float, float]:
            apart, within = seconds(lambda: read(path)), seconds(lambda: read_in_process(path))
            prepared.end()
            return apart, seconds(lambda: read(path)), within

        assert np.array_equal(read(path).values, read_in_process(path).values)
        return [turn() for _ in range(turns)]


def main(turns: int = TURNS) -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    apart, first, within = zip(*measure(turns), strict=True)
    rows = []
    for (which, most_s), taken in zip(MOST_S.items(), (apart, first), strict=True):
        beyond = [a - w for a, w in zip(taken, within, strict=True)]
        median = statistics.median(beyond)
        sys.stdout.write(
            f"24 megapixels{which}: apart {statistics.median(taken):.3f} s, within {statistics.median(within):.3f} s; "
            f"isolation costs {median:.3f} s (least {min(beyond):.3f}, most {max(beyond):.3f}), target {most_s}\n"
        )
        name = f"isolation: seconds beyond decoding within the process, 24 megapixels{which}"
        rows.append({"name": name, "figure": median, "target": most_s, "met": median <= most_s})
    return rows


if __name__ == "__main__":
    main()
