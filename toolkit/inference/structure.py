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
from numpy.typing import NDArray
from scipy.linalg import block_diag

from toolkit.records import Floats

from .cells import Cells
from .lit import lit_by
from .problem import Optimum
from .solving import inverse
from .views import View

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
    """The chance of as much structure in each channel for itself, and of as much in all channels of a photograph.

    Photographs are asked one by one and their statistics added: of a joint fit they are all but independent.
    """
    from scipy.special import chdtrc  # chi-square's upper tail, without the second that scipy.stats takes to import

    covariance = inverse(optimum.joint)
    each = [_statistics(optimum, covariance, v) for v in range(len(optimum.problem.views))]
    plain, alike = (float(chdtrc(*both)) if both[0] else 1.0 for both in np.sum(each, axis=0))
    return plain, alike


def _statistics(optimum: Optimum, covariance: Floats, photograph: int) -> Floats:
    """Degrees of freedom and score statistic of a photograph, of each channel for itself and of all of them (2, 2)."""
    own = optimum.own(photograph)
    channels = [_left(optimum, c, own) for c in range(3 * photograph, 3 * photograph + 3)]
    smooth, waves = _patterns(optimum.problem.views[photograph])
    plain, alike = [(smooth, one) for one in channels], [(np.concatenate([smooth, waves]), _shared(channels, len(own)))]
    of_own = covariance[own[:, None], own]
    return np.array([_statistic(plain, of_own), _statistic(alike, of_own)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Left:
    """What the fit leaves of the N cells' means, where their errors and those of their slopes are allowed for; nothing
    where a cell holds none.

    A pattern over the cells shows in the means alone; what the slopes hold is not asked for.
    """

    predicted: Floats  # (N,)
    weight: Floats  # (N,), of the means beside each other
    residual: Floats  # (N,), weighted
    unknowns: NDArray[np.intp]  # (p,), which of the photograph's own
    design: Floats  # (p, N), the derivatives of the prediction in these, weighted


def _left(optimum: Optimum, channel: int, own: NDArray[np.intp]) -> _Left:
    data, weights = optimum.problem.channels[channel], optimum.weights.weights[channel]
    rows, whole = data.rows[: data.cells], len(optimum.problem.views[channel // 3].cells.x_px)
    unknowns, slopes = optimum.slopes(channel)
    predicted = optimum.predicted[channel]
    return _Left(
        predicted=_of_all(predicted[: data.cells], rows, whole),
        weight=_of_all(weights.of_means, rows, whole),
        residual=_of_all(weights.pulls(data.value - predicted), rows, whole),
        unknowns=np.searchsorted(own, unknowns),
        design=_of_all(weights.pulls(slopes), rows, whole),
    )


def _of_all(values: Floats, rows: NDArray[np.intp], whole: int) -> Floats:
    """Values (..., n) of a channel's cells among all of them (..., whole), 0 of the others."""
    if len(rows) == whole:
        return values
    found = np.zeros((*values.shape[:-1], whole))
    found[..., rows] = values
    return found


def _shared(channels: Sequence[_Left], unknowns: int) -> _Left:
    """What is left of a photograph's channels together, of a pattern that is a share of the picture in each."""
    cells = len(channels[0].predicted)
    weight, residual, design = np.zeros(cells), np.zeros(cells), np.zeros((unknowns, cells))
    for one in channels:
        weight += one.weight * one.predicted**2
        residual += one.residual * one.predicted
        design[one.unknowns] += one.design * one.predicted
    return _Left(
        predicted=np.ones(cells), weight=weight, residual=residual, unknowns=np.arange(unknowns), design=design
    )


def _statistic(asked: Sequence[tuple[Floats, _Left]], covariance: Floats) -> tuple[float, float]:
    """Degrees of freedom and score statistic of patterns (K, N), each in what is left of its own.

    `covariance` (p, p) is the posterior's, of the unknowns that these depend on.
    """
    score = np.concatenate([patterns @ left.residual for patterns, left in asked])
    across = np.zeros((len(score), len(covariance)))
    ends = np.cumsum([0, *(len(patterns) for patterns, _ in asked)])
    for (patterns, left), start, end in zip(asked, ends, ends[1:], strict=False):
        across[start:end, left.unknowns] = patterns @ left.design.T
    weighed = [patterns * np.sqrt(left.weight) for patterns, left in asked]
    kept = block_diag(*(each @ each.T for each in weighed))
    rest = kept - across @ covariance @ across.T
    scale = 1.0 / np.sqrt(np.maximum(np.diag(kept), 1e-300))
    values, vectors = np.linalg.eigh(rest * scale[:, None] * scale)
    whole = values > SMALLEST
    projected = vectors[:, whole].T @ (score * scale)
    return float(whole.sum()), float(np.sum(projected**2 / values[whole]))


def _patterns(view: View) -> tuple[Floats, Floats]:
    """Smooth polynomials over the disc and rings about each highlight (K, N), and waves around the rings (L, N)."""
    scene, cells = view.scene, view.cells
    (cx, cy), radius = scene.sphere.centre_px, scene.sphere.radius_px
    x, y = (_powers((at - centre) / radius) for at, centre in ((cells.x_px, cx), (cells.y_px, cy)))
    smooth = [x[i] * y[j] for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    rings: list[Floats] = []
    waves: list[Floats] = []
    for lit in lit_by(scene, cells.x_px, cells.y_px):
        theta = np.arcsin(np.sqrt(np.clip(lit.cosines.sin2_h, 0.0, 1.0)))
        mine, around = _rings(theta), _around(cells, int(np.argmin(theta)))
        turning = [f(m * around) for m in WAVES for f in (np.cos, np.sin)]
        rings += mine
        waves += [ring * wave for ring in mine for wave in turning]
    return np.stack([*smooth, *rings]), np.stack(waves)


def _powers(values: Floats) -> list[Floats]:
    found: list[Floats] = [np.ones(len(values))]
    for _ in range(DEGREE):
        found.append(found[-1] * values)
    return found


def _rings(theta: Floats) -> list[Floats]:
    return [((theta >= a) & (theta < b)).astype(float) for a, b in zip((0.0, *RINGS_RAD), RINGS_RAD, strict=False)]


def _around(cells: Cells, middle: int) -> Floats:
    """Azimuth of the cells about one of them, rad."""
    return np.asarray(np.arctan2(cells.y_px - cells.y_px[middle], cells.x_px - cells.x_px[middle]))
