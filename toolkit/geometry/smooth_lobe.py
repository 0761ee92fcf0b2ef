"""The smooth part of a highlight about its middle: outwards a spline, around it slow waves, all in the logarithm.

Least absolute deviations by reweighting (Schlossmacher 1973), then again without what stands out above: narrow rays of
any height leave it where it is as long as they are fewer than half of a ring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

INTERVALS = 6  # of the cubic spline outwards, even in the logarithm of the angle
DEGREE = 2  # outwards, of each wave around
DESCENTS, ROUNDS = 12, 4  # of reweighting; of leaving out what stands out
SHARPEST = 0.01  # deviation below which all weigh alike
RIDGE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothLobe:
    """A fitted smooth lobe between two angles from its middle."""

    low: float  # logarithms of the angles
    high: float
    weights: Floats  # (K,)

    def __call__(self, angle: Floats, around: Floats) -> Floats:
        """Its height (N,), in the units of what it was fitted to; nearer the middle than any sample, as at that one."""
        return np.asarray(np.exp(_columns(np.log(angle), around, self.low, self.high) @ self.weights))


def smooth_lobe(angle: Floats, around: Floats, value: Floats, *, excess: float, most: int) -> SmoothLobe:
    """The smooth lobe of samples (N,) with `value` (N,) > 0.

    `angle` (N,) > 0 is from the middle, `around` (N,) from the plane of light and view, rad. What stands out by a share
    of `excess` is left out of the fit; of more than `most` samples every second, third ... is fitted.
    """
    outwards = np.log(angle)
    low, high = float(outwards.min()), float(outwards.max())
    few = slice(None, None, -(-len(value) // most))
    columns, height = _columns(outwards[few], around[few], low, high), np.log(value[few])
    used = np.ones(len(height), bool)
    for _ in range(ROUNDS):
        weights = _least_absolute(columns[used], height[used])
        before, used = used, height - columns @ weights < np.log1p(excess)
        if np.array_equal(used, before):
            break
    return SmoothLobe(low=low, high=high, weights=weights)


def _columns(outwards: Floats, around: Floats, low: float, high: float) -> Floats:
    """Spline and waves (N, K): a tilt in any direction, since the middle is not exactly known; an ellipse in line
    with the plane of light and view, about which an isotropic surface is symmetric.
    """
    from scipy.interpolate import BSpline

    place = np.clip((outwards - low) / max(high - low, 1e-12), 0.0, 1.0)
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, INTERVALS + 1), np.ones(3)])
    spline = BSpline.design_matrix(place, knots, 3).toarray()
    powers = np.vander(2.0 * place - 1.0, DEGREE + 1)
    waves = [wave[:, None] * powers for wave in (np.cos(around), np.sin(around), np.cos(2.0 * around))]
    return np.column_stack([spline, *waves])


def _least_absolute(columns: Floats, value: Floats) -> Floats:
    weight = np.ones(len(value))
    for _ in range(DESCENTS):
        weighted = columns * weight[:, None]
        matrix = weighted.T @ columns
        matrix.flat[:: len(matrix) + 1] += RIDGE * np.trace(matrix)
        found = np.linalg.solve(matrix, weighted.T @ value)
        weight = 1.0 / np.maximum(np.abs(value - columns @ found), SHARPEST)
    return np.asarray(found)
