"""How fast a lobe is evaluated, beside Mitsuba's scalar renderer in the same run.

python -m tests.benchmarks.lobes     prints a table; `make bench` calls `main()`

Array in, values out: ours by `Cosines.of` and `Lobe.value`, Mitsuba's by the plain loop over the array's rows, a vector
and a `bsdf.eval` each, on a part of them and scaled up. Beside it the strictest comparison: the lobe alone with the
cosines made beforehand, and the `eval` calls alone with Mitsuba's vectors made beforehand, nothing to convert.
Most of Mitsuba's time in the first is conversion: read both.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from toolkit.reflectance import LOBES, Cosines

COUNT = 1_000_000
PART = 20_000  # of them for Mitsuba
TARGET = 20.0
TWINS = ("beckmann", "ggx")  # the lobes that Mitsuba has too
UP = np.array([0.0, 0.0, 1.0])


def directions(count: int) -> np.ndarray:
    """Directions over the upper hemisphere."""
    towards = np.random.default_rng(7).normal(size=(count, 3))
    towards[:, 2] = np.abs(towards[:, 2])
    return towards / np.linalg.norm(towards, axis=1, keepdims=True)


def best_s(run: Callable[[], object]) -> float:
    """Processor seconds of the fastest of three runs, which other jobs on the machine lengthen least."""
    taken = []
    for _ in range(3):
        start = time.process_time()
        run()
        taken.append(time.process_time() - start)
    return min(taken)


def ours_s(name: str, light: np.ndarray, view: np.ndarray) -> tuple[float, float]:
    """Seconds for all directions, from the directions and from the cosines."""
    lobe = LOBES[name]
    shape = tuple(parameter.starts[0] for parameter in lobe.parameters)
    cosines = Cosines.of(UP, light, view)
    return best_s(lambda: lobe.value(Cosines.of(UP, light, view), shape)), best_s(lambda: lobe.value(cosines, shape))


def mitsuba_s(name: str, light: np.ndarray, view: np.ndarray) -> tuple[float, float] | None:
    """Seconds for as many directions by Mitsuba's scalar renderer, and of its calls alone; None without Mitsuba."""
    try:
        import mitsuba as mi
    except ImportError:
        return None
    mi.set_variant("scalar_rgb")
    bsdf = mi.load_dict({"type": "roughconductor", "distribution": name, "alpha": 0.1, "material": "none"})
    context, interaction = mi.BSDFContext(), mi.SurfaceInteraction3f()
    interaction.wi = mi.Vector3f(*view)
    part = light[:PART]

    def from_directions() -> None:
        for towards in part:
            bsdf.eval(context, interaction, mi.Vector3f(towards))

    vectors = [mi.Vector3f(*towards) for towards in part]

    def calls_alone() -> None:
        for vector in vectors:
            bsdf.eval(context, interaction, vector)

    scale = len(light) / PART
    return best_s(from_directions) * scale, best_s(calls_alone) * scale


def _row(name: str, ratio: float) -> dict[str, Any]:
    return {"name": name, "figure": round(ratio, 1), "target": TARGET, "met": ratio >= TARGET}


def main() -> list[dict[str, Any]]:
    """Print the table; rows of name, figure, target, met."""
    light, view = directions(COUNT), np.array([0.6, 0.0, 0.8])
    lines, rows = [f"{'a million directions, s':24}ours  lobe alone   Mitsuba  calls alone  ratio  alone"], []
    for name in LOBES:
        ours, lobe = ours_s(name, light, view)
        lines.append(f"{name:20}{ours:8.3f}{lobe:12.3f}")
        theirs = mitsuba_s(name, light, view) if name in TWINS else None
        if theirs:
            lines[-1] += f"{theirs[0]:10.2f}{theirs[1]:13.2f}{theirs[0] / ours:7.1f}{theirs[1] / lobe:7.1f}"
            ratio, alone = theirs[0] / ours, theirs[1] / lobe
            rows.append(_row(f"{name} on a million directions, x Mitsuba scalar", ratio))
            rows.append(_row(f"{name}, the lobe alone against the calls alone", alone))
    sys.stdout.write("\n".join(lines) + "\n")
    return rows


if __name__ == "__main__":
    main()
