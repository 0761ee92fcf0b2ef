"""Scatter over the least that any method could have: root mean squared error over the Cramér-Rao bound.

The bound speaks of photographs that tell the shape well. Where it comes near the width of the prior, the posterior is
bent and cut by the parameter's range, and no bound in closed form holds; such renders count for ranks and coverage,
not here. Which these are is decided by the bound itself, before any photograph, so nothing is chosen by its outcome.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

WELL_TOLD = 0.1  # bound over prior sd of every shape number, up to which the bound can be reached


def well_told(line: Mapping[str, Any]) -> bool:
    """Whether the render's bound is small against what is known beforehand, for each of its shape numbers."""
    shape = [n for n in line["numbers"] if n["channel"] is None]
    return all(n["bound_to_prior"] is not None and n["bound_to_prior"] <= WELL_TOLD for n in shape)


def efficiency(lines: Sequence[Mapping[str, Any]], name: str | None = None) -> tuple[float, float, int]:
    """The ratio for one parameter or all, its sd by chance, and over how many renders; NaN where there is no bound.

    Numbers of one render share their noise, renders do not.
    """
    renders = [_squares(line, name) for line in lines if well_told(line)]
    sums = np.array([sum(of_one) for of_one in renders if of_one])
    counts = np.array([len(of_one) for of_one in renders if of_one])
    if not len(sums):
        return float("nan"), float("nan"), 0
    mean = float(sums.sum() / counts.sum())
    error = float(np.sqrt(np.sum((sums - mean * counts) ** 2)) / counts.sum())
    return mean**0.5, 0.5 * error / max(mean, 1e-300) ** 0.5, len(sums)


def _squares(line: Mapping[str, Any], name: str | None) -> list[float]:
    numbers = [n for n in line["numbers"] if n["bound_sd"] and name in (None, n["name"])]
    return [((n["mean"] - n["truth"]) / n["bound_sd"]) ** 2 for n in numbers]
