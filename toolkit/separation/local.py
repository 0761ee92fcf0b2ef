"""Local polynomials: the value at each pixel of a quadratic fitted to its surroundings, with its variance.

Weighted least squares over a square window (Katkovnik, Egiazarian & Astola 2006, "Local approximation techniques in
signal and image processing", chapter 2); all sums over windows are separable filters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))  # of the offsets x, y over the window's radius
WEAKEST = 1e-6  # what may be left of a diagonal element in elimination; below, the window holds too little


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Local:
    """Values and variances (h, w) of the quadratics at their own centres; NaN where a window holds too little."""

    value: Floats
    variance: Floats

    def __post_init__(self) -> None:
        readonly(self)


def local_quadratic(values: Floats, precision: Floats, radius: int) -> Local:
    """Fit `values` (h, w) with inverse variances `precision` (h, w), 0 where there is no value."""
    known = np.where(precision > 0, values, 0.0) * precision
    moments = {(p, q): _window_sum(precision, radius, p, q) for p in range(5) for q in range(5 - p)}
    right = [_window_sum(known, radius, p, q) for p, q in POWERS]
    matrix = [[moments[p + r, q + s].copy() for r, s in POWERS[: i + 1]] for i, (p, q) in enumerate(POWERS)]
    return _eliminate(matrix, right)


def _window_sum(layer: Floats, radius: int, power_x: int, power_y: int) -> Floats:
    """Sum of layer x dx^power_x dy^power_y over the window about each pixel; nothing beyond the border."""
    import cv2  # slow to import, and only pictures need it

    offset = np.arange(-radius, radius + 1) / radius
    return np.asarray(cv2.sepFilter2D(layer, -1, offset**power_x, offset**power_y, borderType=cv2.BORDER_CONSTANT))


def _eliminate(matrix: list[list[Floats]], right: list[Floats]) -> Local:
    """First unknown of a symmetric system given by its lower triangle of layers (h, w), by Gaussian elimination.

    What is left of the first diagonal element is the inverse of the first unknown's variance.
    """
    firm = matrix[0][0] > 0
    whole = [row[-1].copy() for row in matrix]
    with np.errstate(invalid="ignore", divide="ignore"):
        for k in range(len(right) - 1, 0, -1):
            firm &= matrix[k][k] > WEAKEST * whole[k]
            for i in range(k):
                factor = matrix[k][i] / matrix[k][k]
                for j in range(i + 1):
                    matrix[i][j] -= factor * matrix[k][j]
                right[i] -= factor * right[k]
        firm &= matrix[0][0] > WEAKEST * whole[0]
        left = np.where(firm, matrix[0][0], np.nan)
        return Local(value=right[0] / left, variance=1 / left)
