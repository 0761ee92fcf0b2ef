"""What decoding in a process of its own costs, above decoding within this one.

python -m tests.benchmarks.isolation     prints the figures; `make bench` calls `main()`

A 24-megapixel mosaic as DNG, read both ways in turn; each pair's difference is one measurement, so that a machine that
is busy for a while is so for both. What a caller waits for is counted: the child's start, its imports, the pixels
handed over and the digest, to the record in hand.
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
from toolkit.io.read import read, read_in_process

HEIGHT, WIDTH = 4000, 6000
PAIRS = 15
MOST_S = 0.2  # per 24 megapixels


def photograph(folder: Path) -> Path:
    """A large mosaic of the small picture's statistics."""
    small = good.mosaic()
    tiles = -(-HEIGHT // small.shape[0]), -(-WIDTH // small.shape[1])
    return good.dng(folder / "large.dng", np.tile(small, tiles)[:HEIGHT, :WIDTH])


def seconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def measure(pairs: int = PAIRS) -> tuple[list[float], list[float]]:
    """Seconds apart and within, pair by pair, the page cache and the imports warm."""
    with tempfile.TemporaryDirectory() as name:
        path = photograph(Path(name))
        assert np.array_equal(read(path).values, read_in_process(path).values)
        taken = [(seconds(lambda: read(path)), seconds(lambda: read_in_process(path))) for _ in range(pairs)]
    apart, within = zip(*taken, strict=True)
    return list(apart), list(within)


def main(pairs: int = PAIRS) -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    apart, within = measure(pairs)
    beyond = [a - w for a, w in zip(apart, within, strict=True)]
    median = statistics.median(beyond)
    sys.stdout.write(
        f"24 megapixels: apart {statistics.median(apart):.3f} s, within {statistics.median(within):.3f} s; "
        f"isolation costs {median:.3f} s "
        f"(least {min(beyond):.3f}, most {max(beyond):.3f}), target {MOST_S}\n"
    )
    name = "isolation: seconds beyond decoding within the process, 24 megapixels"
    return [{"name": name, "figure": median, "target": MOST_S, "met": median <= MOST_S}]


if __name__ == "__main__":
    main()
