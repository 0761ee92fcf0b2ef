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
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

from .cells import Cells, ChannelCells
from .model import Columns, lit_by
from .problem import Optimum
from .views import View
from .weights import Weights

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
    """The chance of as much structure in each channel for itself, and of as much in all channels of a photograph."""
    problem = optimum.problem
    columns = problem.columns(optimum.u, derivatives=True)
    predicted = problem.predict(columns, optimum.x)
    plain, whole = [], []
    for view in problem.views:
        smooth, waves = _patterns(view)
        both = np.hstack([smooth, waves])
        plain += [_on_means(data, smooth) for data in view.cells.channels]
        whole += [_on_means(data, both) for data in view.cells.channels]
    left = [
        _Left(residual=data.value - p, weights=weights, design=_design(optimum, columns[c], c))
        for c, (data, p, weights) in enumerate(zip(problem.channels, predicted, optimum.weights.weights, strict=True))
    ]
    alike = [w * p[:, None] for w, p in zip(whole, predicted, strict=True)]
    return _chance(left, plain, optimum.joint, channels=1), _chance(left, alike, optimum.joint, channels=3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Left:
    """What the fit leaves of one channel (n,), with the derivatives (n, P) of its prediction in all unknowns."""

    residual: Floats
    weights: Weights
    design: Floats


def _chance(left: Sequence[_Left], patterns: Sequence[Floats], joint: Floats, *, channels: int) -> float:
    """Of a score statistic as large as that of patterns (n, K) of each channel; each group of `channels` its own."""
    from scipy.special import chdtrc  # chi-square's upper tail, without the second that scipy.stats takes to import

    ends = np.cumsum([0, *(pattern.shape[1] for pattern in patterns[::channels])])
    score, kept, across = np.zeros(ends[-1]), np.zeros((ends[-1], ends[-1])), np.zeros((len(joint), ends[-1]))
    for c, (channel, pattern) in enumerate(zip(left, patterns, strict=True)):
        mine = slice(ends[c // channels], ends[c // channels + 1])
        here = channel.weights.times(pattern.T).T
        score[mine] += here.T @ channel.residual
        kept[mine, mine] += here.T @ pattern
        across[:, mine] += channel.design.T @ here
    rest = kept - across.T @ np.linalg.solve(joint, across)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(kept), 1e-300))
    values, vectors = np.linalg.eigh(rest * scale[:, None] * scale)
    whole = values > SMALLEST
    projected = vectors[:, whole].T @ (score * scale)
    return float(chdtrc(whole.sum(), np.sum(projected**2 / values[whole]))) if whole.any() else 1.0


def _patterns(view: View) -> tuple[Floats, Floats]:
    """Smooth polynomials over the disc and rings about each highlight (N, K), and waves around the rings (N, L)."""
    scene, cells = view.scene, view.cells
    (cx, cy), radius = scene.sphere.centre_px, scene.sphere.radius_px
    x, y = (np.vander((at - c) / radius, DEGREE + 1, increasing=True) for at, c in ((cells.x_px, cx), (cells.y_px, cy)))
    smooth = [x[:, i] * y[:, j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    rings: list[Floats] = []
    waves: list[Floats] = []
    for lit in lit_by(scene, cells.x_px, cells.y_px):
        theta = np.arcsin(np.sqrt(np.clip(lit.cosines.sin2_h, 0.0, 1.0)))
        mine, around = _rings(theta), _around(cells, int(np.argmin(theta)))
        turning = [f(m * around) for m in WAVES for f in (np.cos, np.sin)]
        rings += mine
        waves += [ring * wave for ring in mine for wave in turning]
    return np.stack([*smooth, *rings], axis=1), np.stack(waves, axis=1)


def _on_means(data: ChannelCells, patterns: Floats) -> Floats:
    """Patterns over the cells as they show in one channel's means; what its slopes hold is not asked for."""
    found = np.zeros((len(data.rows), patterns.shape[1]))
    found[: data.cells] = patterns[data.rows[: data.cells]]
    return found


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
