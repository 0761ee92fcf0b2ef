"""Is what the model leaves noise? A test of the residuals for structure, far sharper than their sum of squares.

The noise of ten thousand cells hides a misfit that runs smoothly over the whole ball: it adds almost nothing to any
one of them. So the residuals are asked only for what a broken assumption would leave: smooth patterns over the disc
(stray light, a second lamp, an egg), and rings about the highlight (another lobe). Rao's score test (1948): the
patterns' scores, judged by the covariance that is left once the fit has taken from them all that it can explain.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cells import Cells
from .fit import Optimum
from .model import Columns, lit_by

LEAST_P = 1e-4  # below it the residuals are not taken for noise
DEGREE = 5  # of the smooth patterns
RINGS_RAD = (0.03, 0.06, 0.12, 0.24, 0.5)  # edges of the rings about the half vector
SMALLEST = 1e-6  # of a pattern's own variance, below which the fit has explained it away


def structure_p(optimum: Optimum) -> float:
    """Chance that noise alone leaves as much structure in the residuals as this fit has left."""
    from scipy.stats import chi2

    statistic, freedom = structure_of(optimum)
    return float(chi2.sf(statistic, freedom)) if freedom else 1.0


def structure_of(optimum: Optimum) -> tuple[float, int]:
    """The score statistic of all patterns in all channels, and its degrees of freedom."""
    problem = optimum.problem
    columns = problem.columns(optimum.u, derivatives=True)
    predicted = problem.predict(columns, optimum.x)
    patterns = _patterns(optimum)
    count = patterns.shape[1]
    score, kept, across = np.zeros(3 * count), np.zeros((3 * count,) * 2), np.zeros((len(optimum.joint), 3 * count))
    for c, (data, weight) in enumerate(zip(problem.cells.channels, optimum.weights.weights, strict=True)):
        mine = slice(c * count, (c + 1) * count)
        here = patterns[data.rows] * weight[:, None]
        score[mine] = here.T @ (data.value - predicted[c])
        kept[mine, mine] = here.T @ patterns[data.rows]
        across[:, mine] = _design(optimum, columns[c], c).T @ here
    left = kept - across.T @ np.linalg.solve(optimum.joint, across)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(kept), 1e-300))
    values, vectors = np.linalg.eigh(left * scale[:, None] * scale)
    whole = values > SMALLEST
    projected = vectors[:, whole].T @ (score * scale)
    return float(np.sum(projected**2 / values[whole])), int(whole.sum())


def _patterns(optimum: Optimum) -> Floats:
    """Smooth polynomials over the disc and rings about each highlight (N, K), at the cells' places."""
    scene, cells = optimum.problem.scene, optimum.problem.cells
    (cx, cy), radius = scene.sphere.centre_px, scene.sphere.radius_px
    x, y = (cells.x_px - cx) / radius, (cells.y_px - cy) / radius
    smooth = [x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    return np.stack([*smooth, *_rings(optimum, cells)], axis=1)


def _rings(optimum: Optimum, cells: Cells) -> list[Floats]:
    found = []
    for lit in lit_by(optimum.problem.scene, cells.x_px, cells.y_px):
        theta = np.arcsin(np.sqrt(np.clip(lit.cosines.sin2_h, 0.0, 1.0)))
        edges = (0.0, *RINGS_RAD)
        found += [((theta >= a) & (theta < b)).astype(float) for a, b in zip(edges, RINGS_RAD, strict=False)]
    return found


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
