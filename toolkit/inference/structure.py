"""Is what the model leaves noise? A test of the residuals for structure, far sharper than their sum of squares.

The noise of ten thousand cells hides a misfit that runs smoothly over the whole ball: it adds almost nothing to any
one of them. So the residuals are asked only for what a broken assumption would leave, in two ways. Each channel for
itself: smooth patterns over the disc (stray light, a second lamp), and rings about the highlight (another lobe). And
as a share of the picture, the same in all channels of a photograph, as everything that is wrong with the geometry
leaves it: these patterns, and the rings' two lowest waves around the highlight (an egg, a light or outline that is
off). Rao's score test (1948): the patterns' scores, judged by the covariance that is left once the fit has taken from
them all that it can explain.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolkit.records import Floats

from .cells import Cells
from .fit import Optimum, View
from .model import Columns, lit_by

LEAST_P = 1e-3  # below it the residuals are not taken for noise
DEGREE = 5  # of the smooth patterns
RINGS_RAD = (0.03, 0.06, 0.12, 0.24, 0.5)  # edges of the rings about the half vector
WAVES = (1, 2)  # around each ring
SMALLEST = 1e-6  # of a pattern's own variance, below which the fit has explained it away


def structure_p(optimum: Optimum) -> float:
    """Chance that noise alone leaves as much structure in the residuals as this fit has left, in either way."""
    chances = structure_chances(optimum)
    return min(1.0, len(chances) * min(chances))


def structure_chances(optimum: Optimum) -> tuple[float, float]:
    """The chance of as much structure in each channel for itself, and of as much in all of them alike."""
    problem = optimum.problem
    columns = problem.columns(optimum.u, derivatives=True)
    predicted = problem.predict(columns, optimum.x)
    plain, whole = [], []
    for view in problem.views:
        smooth, waves = _patterns(view)
        plain += [smooth[data.rows] for data in view.cells.channels]
        whole += [np.hstack([smooth, waves])[data.rows] for data in view.cells.channels]
    alike = _by_group([w * p[:, None] for w, p in zip(whole, predicted, strict=True)], channels=3)
    apart = _by_group(plain, channels=1)
    return _chance(optimum, columns, predicted, apart), _chance(optimum, columns, predicted, alike)


def _chance(
    optimum: Optimum, columns: Sequence[Columns], predicted: Sequence[Floats], patterns: Sequence[Floats]
) -> float:
    """Of a score statistic as large as that of patterns (n, K), one array a channel."""
    from scipy.stats import chi2

    count = patterns[0].shape[1]
    score, kept, across = np.zeros(count), np.zeros((count, count)), np.zeros((len(optimum.joint), count))
    for c, (data, weight) in enumerate(zip(optimum.problem.channels, optimum.weights.weights, strict=True)):
        here = patterns[c] * weight[:, None]
        score += here.T @ (data.value - predicted[c])
        kept += here.T @ patterns[c]
        across += _design(optimum, columns[c], c).T @ here
    left = kept - across.T @ np.linalg.solve(optimum.joint, across)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(kept), 1e-300))
    values, vectors = np.linalg.eigh(left * scale[:, None] * scale)
    whole = values > SMALLEST
    projected = vectors[:, whole].T @ (score * scale)
    return float(chi2.sf(np.sum(projected**2 / values[whole]), whole.sum())) if whole.any() else 1.0


def _by_group(patterns: Sequence[Floats], *, channels: int) -> list[Floats]:
    """Patterns (n, K) of all channels, those of each group of `channels` in columns of their own (n, all of them)."""
    ends = np.cumsum([0, *(patterns[c].shape[1] for c in range(0, len(patterns), channels))])
    found = []
    for c, mine in enumerate(patterns):
        wide = np.zeros((len(mine), ends[-1]))
        wide[:, ends[c // channels] : ends[c // channels + 1]] = mine
        found.append(wide)
    return found


def _patterns(view: View) -> tuple[Floats, Floats]:
    """Smooth polynomials over the disc and rings about each highlight (N, K), and waves around the rings (N, L)."""
    scene, cells = view.scene, view.cells
    (cx, cy), radius = scene.sphere.centre_px, scene.sphere.radius_px
    x, y = (cells.x_px - cx) / radius, (cells.y_px - cy) / radius
    smooth = [x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    rings: list[Floats] = []
    waves: list[Floats] = []
    for lit in lit_by(scene, cells.x_px, cells.y_px):
        theta = np.arcsin(np.sqrt(np.clip(lit.cosines.sin2_h, 0.0, 1.0)))
        mine, around = _rings(theta), _around(cells, int(np.argmin(theta)))
        rings += mine
        waves += [ring * f(m * around) for ring in mine for m in WAVES for f in (np.cos, np.sin)]
    return np.stack([*smooth, *rings], axis=1), np.stack(waves, axis=1)


def _rings(theta: Floats) -> list[Floats]:
    return [((theta >= a) & (theta < b)).astype(float) for a, b in zip((0.0, *RINGS_RAD), RINGS_RAD, strict=False)]


def _around(cells: Cells, middle: int) -> Floats:
    """Azimuth of the cells about one of them, rad."""
    return np.asarray(np.arctan2(cells.y_px - cells.y_px[middle], cells.x_px - cells.x_px[middle]))


def _design(optimum: Optimum, columns: Columns, channel: int) -> Floats:
    """Derivative of one channel's prediction in all unknowns (n, P): colours, shifts, shape."""
    layout = optimum.problem.layout
    index = layout.index[channel]
    here = optimum.x[index]
    result = np.zeros((len(columns.offset), len(optimum.joint)))
    result[:, index] = columns.matrix
    result[:, len(layout.names) : layout.size] = optimum.problem.extras[channel]
    for d, (matrix, offset) in enumerate(zip(columns.d_matrix, columns.d_offset, strict=True)):
        result[:, layout.size + d] = matrix @ here + offset
    return result
