"""What a joint fit costs by the number of its photographs: each one's calibration is its own, so no more than they.

python -m tests.benchmarks.joint     prints the figures; `make bench` calls `main()`

A ball of 200 pixels under lights 15 to 75 degrees off the axis, the same model fitted to the first few of its
photographs and to four times as many. Processor seconds, and the most memory that the fit holds at a time.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from typing import Any

import numpy as np

from tests.inference.test_joint import EXACT, joint, views

FEW, MANY = 4, 16
TARGET = 1.5 * MANY / FEW


def cost(photographs: int) -> tuple[float, float]:
    """Processor seconds and peak bytes of one fit: the second of two, imports and tables done."""
    seen = views(*np.linspace(15.0, 75.0, photographs), seed=1, known=True)
    joint(seen, EXACT)
    begin = time.process_time()
    joint(seen, EXACT)
    taken = time.process_time() - begin
    tracemalloc.start()
    joint(seen, EXACT)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return taken, float(peak)


def main() -> list[dict[str, Any]]:
    """Print the figures; rows of name, figure, target, met."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        few, many = cost(FEW), cost(MANY)
    sys.stdout.writelines(
        f"{n} photographs: {taken:.2f} s, {peak / 2**20:.0f} MiB\n" for n, (taken, peak) in ((FEW, few), (MANY, many))
    )
    rows = []
    for what, a, b in zip(("processor time", "memory"), few, many, strict=True):
        name = f"joint fit of {MANY} photographs, {what} x that of {FEW}"
        rows.append({"name": name, "figure": b / a, "target": TARGET, "met": b / a <= TARGET})
        sys.stdout.write(f"{name:66} {b / a:10.3g}  asked {TARGET:g}  {b / a <= TARGET}\n")
    return rows


if __name__ == "__main__":
    main()
