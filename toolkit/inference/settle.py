"""Fit and calibration together: the scene moves until it, the shape and the data's weight stand.

Around an optimum the radiance is linear in the shifts of the calibration, so they join the colours as columns with
their prior; the scene moves by what was found and the columns are taken anew (Gauss-Newton).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from .fit import fit, minima
from .model import columns
from .normal import inverse, weigh
from .nuisances import Shifts, shifted
from .problem import Optimum, Problem, chi2_at, pose_views
from .tempering import chi2_tempered, stands, tempering_of
from .views import View

RELATIVE_STEP = 1e-3  # of the prior's sd, for the differences: far above rounding, far below curvature
ROUNDS = 20
SETTLED_SD = 0.1  # posterior sds of the last move: its own error is of second order in it
SETTLED_PRIOR_SD = 0.02  # or prior sds, where a wrong model makes the posterior absurdly narrow
SHARES = (1.0, 0.4, 0.15, 0.05)  # of a move, tried in turn
MISLED = 30.0  # fall of chi-square through the calibration from which the shape is searched anew


def fit_with_shifts(
    problem: Problem, shifts: Shifts, blocks: Sequence[NDArray[np.intp]] = ()
) -> tuple[Optimum, Floats]:
    """The optimum with the shifts free; also the shifts at which the scene came to stand.

    A wrong calibration can make a wrong shape look best, so each distinct optimum is followed; where the calibration
    then moved by much, the shape is searched once more. With `blocks`, one a photograph, (N,) the block of every cell,
    the data weigh less where they do not fit: see `tempering`.
    """
    nowhere = np.zeros(len(shifts.names))
    if not shifts.names and not blocks:
        return fit(problem), nowhere
    starts = minima(problem)
    best, total = _best([_follow(problem, optimum, shifts, nowhere, blocks) for optimum in starts])
    if not shifts.names or _fallen(starts[0], best) < MISLED:
        return best, total
    moved = _moved(problem, shifts, total)
    return _best([(best, total), *(_follow(problem, optimum, shifts, total, blocks) for optimum in minima(moved))])


def _moved(problem: Problem, shifts: Shifts, total: Floats) -> Problem:
    """The problem in the shifted scenes, without columns for further shifts."""
    views = _views(problem, shifts, total)
    return pose_views(problem.model, views, fresnel=problem.fresnel, tempering=problem.tempering)


def _views(problem: Problem, shifts: Shifts, total: Floats) -> list[View]:
    return [view.moved(shifted(view.scene, shifts, total, v)) for v, view in enumerate(problem.views)]


def _best(found: Sequence[tuple[Optimum, Floats]]) -> tuple[Optimum, Floats]:
    """The pair of least chi-square, all with the weight that the data have where they fit best."""
    least = min(optimum.problem.tempering for optimum, _ in found)
    return min(found, key=lambda pair: chi2_tempered(pair[0], least))


def _fallen(start: Optimum, best: Optimum) -> float:
    """How far chi-square fell from where a search ended, with the weight that the data have now."""
    return chi2_tempered(start, best.problem.tempering) - best.chi2


def _follow(
    problem: Problem, optimum: Optimum, shifts: Shifts, total: Floats, blocks: Sequence[NDArray[np.intp]]
) -> tuple[Optimum, Floats]:
    """Gauss-Newton in the shifts, beginning at `total`; a step that makes the picture worse is shortened.

    So are all that follow one which went back on the one before it: where clipped cells change sides from round to
    round, two places can lead to each other for ever.
    """
    tempering, reach = tempering_of(optimum, blocks), 1.0
    last: Floats = np.zeros(len(total))
    for _ in range(ROUNDS):
        problem = replace(problem, tempering=tempering)
        optimum = fit(_linearised(problem, optimum, shifts, total), start=optimum)
        layout, tempering = optimum.problem.layout, tempering_of(optimum, blocks)
        moved = optimum.x[len(layout.names) :]
        sd = np.sqrt(np.diag(inverse(optimum.joint))[len(layout.names) : layout.size])
        settled = np.all(np.abs(moved) <= np.maximum(SETTLED_SD * sd, SETTLED_PRIOR_SD * shifts.sd))
        if settled and stands(tempering, problem.tempering):
            return optimum, total + moved
        reach *= 0.5 if float(np.sum(moved * last / sd**2)) < 0.0 else 1.0
        last = _share(problem, optimum, shifts, total, moved) * reach * moved
        total = total + last
    return replace(optimum, status=f"calibration not settled after {ROUNDS} rounds"), total


def _linearised(problem: Problem, optimum: Optimum, shifts: Shifts, total: Floats) -> Problem:
    """The problem with the scenes shifted by `total` and further small shifts as columns."""
    return pose_views(
        problem.model,
        _views(problem, shifts, total),
        fresnel=optimum.problem.fresnel,
        extras=sensitivity(optimum, problem.views, shifts, total),
        extras_precision=shifts.precision,
        extras_centre=-total,
        tempering=problem.tempering,
    )


def _share(problem: Problem, optimum: Optimum, shifts: Shifts, total: Floats, moved: Floats) -> float:
    """How much of a move to make: all, unless the picture, not linearised, would be worse there than before."""
    if not len(moved):
        return 1.0
    weights, problem = weigh(optimum.weights.weights, problem.extras), replace(problem, fresnel=optimum.problem.fresnel)
    prior = shifts.precision

    def chi2(values: Floats) -> float:
        return chi2_at(_moved(problem, shifts, values), optimum.u, weights) + float(values @ prior @ values)

    here = chi2(total)
    return next((share for share in SHARES if chi2(total + share * moved) < here), SHARES[-1])


def sensitivity(optimum: Optimum, views: Sequence[View], shifts: Shifts, total: Floats) -> tuple[Floats, ...]:
    """Per channel, the change of the predicted radiance with each shift (n, q), by differences.

    `views` are the photographs as told, `total` the shifts at which the change is asked for.
    """
    found: list[Floats] = []
    steps = np.diag(RELATIVE_STEP * shifts.sd)
    for v, view in enumerate(views):
        here = _predicted(optimum, view, shifts, total, v)
        slopes = [np.zeros((len(values), len(steps))) for values in here]
        for j in np.flatnonzero(shifts.photograph == v):
            there = _predicted(optimum, view, shifts, total + steps[j], v)
            for slope, after, before in zip(slopes, there, here, strict=True):
                slope[:, j] = (after - before) / steps[j, j]
        found += slopes
    return tuple(found)


def _predicted(optimum: Optimum, view: View, shifts: Shifts, values: Floats, photograph: int) -> list[Floats]:
    """What an optimum predicts of one photograph's three channels with the shifts at these values."""
    problem = optimum.problem
    there = view.moved(shifted(view.scene, shifts, values, photograph))
    cols = columns(problem.model, problem.fresnel, there.lights, there.cells, optimum.u)
    index = problem.layout.index[3 * photograph : 3 * photograph + 3]
    return [c.matrix @ optimum.x[i] + c.offset for c, i in zip(cols, index, strict=True)]
