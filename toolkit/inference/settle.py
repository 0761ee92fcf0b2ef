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

from .descend import Projection, project
from .fit import PLAIN, fit
from .normal import weigh
from .nuisances import Shifts, shifted
from .problem import Optimum, Problem, weighing_at
from .refine import refine
from .search import beside, search, strides, thinned
from .sensitivity import sensitivity
from .solving import inverse
from .tempering import STANDS, chi2_tempered, next_tempering, stands, tempering_of
from .views import View

ROUNDS, FEW_ROUNDS = 20, 6  # of moves, with all cells and with a few
PATIENCE, LOOSER = 4, 4.0  # rounds in which all is asked to stand closely, and how many times less closely then
SETTLED_SD = 0.05  # posterior sds of the last move: its own error is of second order in it
SETTLED_PRIOR_SD = 0.01  # or prior sds, where a wrong model makes the posterior absurdly narrow
LINEAR_SD = 0.02  # by which the bend of a move may shift the answer
TEMPERINGS = 4  # of one linearised problem, at most
SHARES = (1.0, 0.4, 0.15, 0.05)  # of a move, tried in turn
LONGEST_SD = 4.0  # prior sds of a shift that one move takes at most: what is linear ends long before

Blocks = Sequence[NDArray[np.intp]]
Stand = tuple[Optimum, Floats]  # where all came to rest, and the shifts there


def fit_with_shifts(problem: Problem, shifts: Shifts, blocks: Blocks = ()) -> Stand:
    """The optimum with the shifts free; also the shifts at which the scene came to stand.

    A wrong calibration can make a wrong shape look best, so each distinct optimum is followed, and the shape is
    searched once more with the calibration free about where it came to stand. All that on a few of the cells; what
    ends about as well as the best goes on from there with all of them. With `blocks`, one a photograph, (N,) the
    block of every cell, the data weigh less where they do not fit: see `tempering`.
    """
    nowhere = np.zeros(len(shifts.names))
    if not shifts.names and not blocks:
        return fit(problem), nowhere
    few, times = thinned(problem), strides(problem)
    few_blocks = [block[::every] for block, every in zip(blocks, times, strict=False)]
    starts = search(few)
    found = [_follow(few, start, shifts, nowhere, few_blocks, rounds=FEW_ROUNDS) for start in starts]
    best, total = _best(found)
    found += [_follow(few, start, shifts, total, few_blocks, rounds=FEW_ROUNDS) for start in beside(best)]
    more = problem.samples / few.samples
    ends = []
    for optimum, total in _rivals(found):
        guess = max(optimum.problem.tempering * more, 1.0) if optimum.problem.tempering > 1.0 else 1.0
        ends.append(_follow(problem, optimum, shifts, total, blocks, tempering=guess))
    return _best(ends)


def _rivals(found: Sequence[Stand]) -> list[Stand]:
    """The best, and those hardly worse that lie elsewhere."""
    best = _best(found)
    least = min(optimum.problem.tempering for optimum, _ in found)
    kept = [best]
    for stand in found:
        near = chi2_tempered(stand[0], least) < chi2_tempered(best[0], least) + PLAIN
        if near and all(_apart(stand[0], other[0]) for other in kept):
            kept.append(stand)
    return kept


def _apart(one: Optimum, other: Optimum) -> bool:
    """Whether two optima differ in their shape by more than an sd."""
    size = one.problem.layout.size
    sd = np.sqrt(np.diag(inverse(one.joint))[size:])
    return bool(np.any(np.abs(one.u - other.u) > sd))


def _views(problem: Problem, shifts: Shifts, total: Floats) -> tuple[View, ...]:
    """The photographs in their shifted scenes."""
    if not total.any():
        return problem.views
    return tuple(view.moved(shifted(view.scene, shifts, total, v)) for v, view in enumerate(problem.views))


def _best(found: Sequence[Stand]) -> Stand:
    """The pair of least chi-square, all with the weight that the data have where they fit best."""
    least = min(optimum.problem.tempering for optimum, _ in found)
    return min(found, key=lambda pair: chi2_tempered(pair[0], least))


def _follow(
    problem: Problem,
    start: Optimum,
    shifts: Shifts,
    total: Floats,
    blocks: Blocks,
    *,
    tempering: float | None = None,
    rounds: int = ROUNDS,
) -> Stand:
    """Gauss-Newton in the shifts, beginning at `total`; a step that makes the picture worse is shortened.

    Where clipped cells change sides from round to round, two places can lead to each other for ever, each of which all
    but stands: after some rounds that is enough.
    """
    here, step = _begun(problem, start, shifts, total, tempering or tempering_of(start, blocks)), 0.0
    for turn in range(rounds):
        end, found, step = _tempered_optimum(_linearised(problem, here, shifts, total), here, blocks, step)
        looser, moved = 1.0 if turn < PATIENCE else LOOSER, _moved(end)
        weighed = stands(found, end.problem.tempering, STANDS**looser)
        if weighed and _short(end, shifts, looser):
            return end, total + moved
        there = _posed(problem, here, end, shifts, total + moved)
        if weighed and _bend(end, there) <= looser * LINEAR_SD:
            return end, total + moved
        here, share = _downhill(problem, here, end, there, shifts, total)
        tempering, step = next_tempering(end.problem.tempering, found, step)
        here, total = _tempered(here, tempering), total + share * moved
    return replace(end, status=f"calibration not settled after {rounds} rounds"), total


def _moved(end: Optimum) -> Floats:
    """The further shifts that a linearised problem came to."""
    return end.x[len(end.problem.layout.names) :]


def _short(end: Optimum, shifts: Shifts, looser: float) -> bool:
    """Whether a move is so short that its end needs no second look."""
    layout, moved = end.problem.layout, _moved(end)
    sd = np.sqrt(np.diag(inverse(end.joint))[len(layout.names) : layout.size])
    return bool((np.abs(moved) <= looser * np.maximum(SETTLED_SD * sd, SETTLED_PRIOR_SD * shifts.sd)).all())


def _begun(problem: Problem, start: Optimum, shifts: Shifts, total: Floats, tempering: float) -> Projection:
    """At the shape of a neighbouring problem, weighed by what its colours predict."""
    views = _views(problem, shifts, total)
    posed = replace(problem, views=views, fresnel=start.problem.fresnel, tempering=tempering)
    columns = posed.columns(start.u, derivatives=True)
    return project(posed, start.u, weighing_at(posed, posed.predict(columns, start.x[: posed.layout.size])), columns)


def _tempered(here: Projection, tempering: float) -> Projection:
    """The same place with another weight of the data."""
    lighter = here.problem.tempering / tempering
    if lighter == 1.0:
        return here
    return project(replace(here.problem, tempering=tempering), here.u, here.weights.scaled(lighter), here.columns)


def _linearised(problem: Problem, here: Projection, shifts: Shifts, total: Floats) -> Problem:
    """With the scenes shifted by `total`, and further small shifts as columns."""
    extras = sensitivity(here, problem.views, here.problem.views, shifts, total)
    return here.problem.with_extras(extras, shifts.precision, -total)


def _tempered_optimum(linear: Problem, here: Projection, blocks: Blocks, step: float) -> tuple[Optimum, float, float]:
    """The optimum of a linearised problem, in turn with its tempering; the tempering found there, and the last step."""
    end = refine(linear, here.u, weigh(here.weights.weights, linear.extras), here.columns)
    found = tempering_of(end, blocks)
    for _ in range(TEMPERINGS):
        before = end.problem.tempering
        if stands(found, before):
            break
        tempering, step = next_tempering(before, found, step)
        tempered = replace(end.problem, tempering=tempering)
        end = refine(tempered, end.at, end.weights.scaled(before / tempering), end.columns)
        found = tempering_of(end, blocks)
    return end, found, step


def _bend(end: Optimum, there: Problem) -> float:
    """How far off the linear prediction of a move is, in sds: by no more can it put an unknown wrong."""
    predicted = there.predict(there.columns(end.u), end.x[: there.layout.size])
    bent = zip(predicted, end.predicted, end.weights.weights, strict=True)
    return float(np.sqrt(sum(float(w.times(p - q) @ (p - q)) for p, q, w in bent)))


def _posed(problem: Problem, here: Projection, end: Optimum, shifts: Shifts, total: Floats) -> Problem:
    """The problem in the scenes shifted by `total`, otherwise as at the end of a move."""
    views = _views(problem, shifts, total)
    return replace(here.problem, views=views, fresnel=end.problem.fresnel, tempering=end.problem.tempering)


def _downhill(
    problem: Problem, here: Projection, end: Optimum, whole: Problem, shifts: Shifts, total: Floats
) -> tuple[Projection, float]:
    """How much of a move to make: the `whole`, unless it is too long or its picture, not linearised, would be worse."""
    moved, prior = _moved(end), shifts.precision

    def chi2(at: Projection, values: Floats) -> float:
        return at.chi2 + float(values @ prior @ values)

    before = chi2(project(here.problem, here.u, weigh(end.weights.weights, here.problem.extras), here.columns), total)
    most = min(1.0, LONGEST_SD / float(np.max(np.abs(moved) / shifts.sd, initial=LONGEST_SD)))
    for share in (most * part for part in SHARES):
        posed = whole if share == 1.0 else _posed(problem, here, end, shifts, total + share * moved)
        there = project(posed, here.u + share * (end.u - here.u), weigh(end.weights.weights, posed.extras))
        if chi2(there, total + share * moved) < before:
            break
    return there, share
