"""Gauss-Newton in the shape alone, everything linear solved for at each step (Golub & Pereyra 1973)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from .normal import Layout, Normal, Sums, Weighing, sums_of, weigh
from .problem import Evaluated, Optimum, Problem
from .solving import bounded, solve

STEPS = 25
STANDS_SD = 0.01  # sds by which what is left undone may still move the shape
LONGEST_STEP, LONGEST_SHARE = 0.7, 0.25  # a factor of two in a logarithm; of a range
SIDES = 12  # times that clipped data may change sides at one shape
SHORT_OF_BOUND, ONTO_BOUND = 0.1, 0.01  # of the way to a bound that one step leaves; of the range, from where none


def descend(
    problem: Problem, u: Floats, weights: Weighing, cols: Evaluated | None = None, *, lands_sd: float = STANDS_SD
) -> Optimum:
    """Gauss-Newton in the shape with everything else projected out; shorter steps where one would climb.

    `lands_sd`, sds by which the end of a short step may be off that is not looked at again.
    """
    low, high = problem.model.bounds()
    here = _off_dead_ends(project(problem, u, weights, cols), weights)
    status = f"not converged after {STEPS} steps"
    last: Floats = np.zeros(len(here.joint.rhs))
    for _ in range(STEPS):
        u, step = here.u, _joint_step(here, low, high)
        near, far = _reach(u, low, high)
        moved = step[problem.layout.size :]
        sd = shape_sd(here.joint.matrix, problem.layout)
        wanted = np.clip(u + moved, near, far) - u
        if _lands(here, step, wanted, sd, lands_sd):
            status, last = "converged", step
            break
        if (np.abs(wanted) <= np.maximum(STANDS_SD * sd, 1e-9)).all():
            status = "converged"
            break
        for factor in (1.0, 0.4, 0.15, 0.05, 0.01, 0.001):
            there = project(problem, np.clip(u + factor * moved, near, far), weights)
            if there.chi2 < here.chi2:
                break
        else:  # nothing lower along the step: as good as it gets
            status = "converged"
            break
        gained, here = here.chi2 - there.chi2, there
        if factor == 1.0 and gained < STANDS_SD**2:  # of sds: steps that only creep along a flat valley
            status = "converged"
            break
    return _rest(here, last, status)


def _off_dead_ends(here: Projection, weights: Weighing) -> Projection:
    """The same place, or one a little inside a bound on which the data say nothing, since a lobe's slope is 0 there.

    Where that one is worse the bound is the better end, told by the data after all.
    """
    problem, (low, high) = here.problem, here.problem.model.bounds()
    told = here.joint.matrix.diagonal()[problem.layout.size :] > (1.0 + 1e-6) * problem.shape_precision
    if told.all():
        return here
    inside = ONTO_BOUND * (high - low)
    within = np.where(told, here.u, np.clip(here.u, low + inside, high - inside))
    if np.array_equal(within, here.u):
        return here
    there = project(problem, within, weights)
    return there if there.chi2 < here.chi2 else here


def _lands(here: Projection, step: Floats, wanted: Floats, sd: Floats, lands_sd: float) -> bool:
    """Whether a step is so short that its end needs no second look: linear there to `lands_sd`, nothing at a bound.

    A step s along a scale L (a longest step) errs by s^2 / L, and by s sd / L for each sd of misfit.
    """
    problem = here.problem
    x, moved = here.x + step[: len(here.x)], step[len(here.x) :]
    way = np.abs(moved)
    if here.on_bound.any() or len(moved) == 0 or (np.abs(moved - wanted) > 1e-9 * way + 1e-15).any():
        return False
    if ((x < problem.prior.low) | (x > problem.prior.high)).any():
        return False
    misfit = 1.0 + misfit_root(here.chi2, here.weights.counted, problem.tempering)
    error = way * (way + sd * misfit) / _longest(*problem.model.bounds())
    return bool((error <= lands_sd * sd).all())


def _rest(here: Projection, step: Floats, status: str) -> Optimum:
    """The end of a descent, after a last `step` of linear unknowns and shape."""
    problem, size = here.problem, len(here.x)
    low, high = problem.model.bounds()
    u, x = here.u + step[size:], here.x + step[:size]
    return Optimum(
        problem=problem,
        u=u,
        x=x,
        weights=here.weights,
        joint=here.joint.matrix,
        chi2=here.chi2 - float(step @ here.joint.rhs),
        on_bound=np.concatenate([here.on_bound, (u <= low + 1e-9) | (u >= high - 1e-9)]),
        status=status,
        at=here.u,
        columns=here.columns,
        predicted=problem.predict(here.columns, x, step[size:]),
    )


def _reach(u: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """How far one step may go: most of the way to a bound, onto it only from close by.

    A long step that ends on a bound can stay there for good: at roughness 0 Oren-Nayar's slope in it is 0.
    """
    close = ONTO_BOUND * (high - low)
    near = np.where(u - low > close, low + SHORT_OF_BOUND * (u - low), low)
    far = np.where(high - u > close, high - SHORT_OF_BOUND * (high - u), high)
    return near, far


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Projection:
    """A shape with everything linear solved for, and the joint equations of the step from there."""

    problem: Problem
    u: Floats
    columns: Evaluated
    weights: Weighing
    x: Floats
    chi2: float
    on_bound: NDArray[np.bool_]
    joint: Normal


def project(problem: Problem, u: Floats, weights: Weighing, cols: Evaluated | None = None) -> Projection:
    """Solve for everything linear at a shape; of the clipped data those count of which the prediction falls short."""
    cols = problem.columns(u, derivatives=True) if cols is None else cols
    weights, sums, x, on_bound, chi2 = _linear(problem, cols, weights)
    joint = problem.combine(cols, sums, weights, x)
    return Projection(
        problem=problem, u=u, columns=cols, weights=weights, x=x, chi2=chi2, on_bound=on_bound, joint=joint
    )


def chi2_at(problem: Problem, cols: Evaluated, weights: Weighing) -> float:
    """The least chi-square at a shape, as `project` finds it, for a look that goes nowhere from there."""
    return _linear(problem, cols, weights)[-1]


def _linear(
    problem: Problem, cols: Evaluated, weights: Weighing
) -> tuple[Weighing, tuple[Sums, ...], Floats, NDArray[np.bool_], float]:
    """Weights, sums, everything linear, what of it rests on a bound, chi-square."""
    for _ in range(SIDES):
        sums = sums_of(cols, problem.channels, weights)
        normal = problem.combine(cols, sums, weights)
        x, on_bound = bounded(normal.matrix, normal.rhs, problem.prior)
        before, weights = weights, _sided(problem, cols, x, weights)
        if weights is before:
            break
    return before, sums, x, on_bound, normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs)


def _sided(problem: Problem, cols: Evaluated, x: Floats, weights: Weighing) -> Weighing:
    """The weights with the clipped data on the sides where they lie of what is predicted; themselves if they did."""
    if not any(len(w.clipped) for w in weights.weights):
        return weights
    predicted = problem.predict(cols, x)
    sided = tuple(
        w.sided(p[w.clipped] < data.value[w.clipped])
        for w, p, data in zip(weights.weights, predicted, problem.channels, strict=True)
    )
    same = all(one is other for one, other in zip(sided, weights.weights, strict=True))
    return weights if same else weigh(sided, problem.extras)


def _joint_step(here: Projection, low: Floats, high: Floats) -> Floats:
    """The Gauss-Newton step of linear unknowns and shape, what rests on a bound held there, shortened where long."""
    size, u, joint = len(here.x), here.u, here.joint
    if len(u) == 0:
        return np.zeros(size)
    pinned = ((u <= low) & (joint.rhs[size:] < 0)) | ((u >= high) & (joint.rhs[size:] > 0))
    free = np.flatnonzero(~np.concatenate([here.on_bound, pinned]))
    step = np.zeros(len(joint.rhs))
    damped = joint.matrix[free[:, None], free]
    damped.flat[:: len(free) + 1] *= 1.0 + 1e-9
    step[free] = solve(damped, joint.rhs[free])
    return np.asarray(step / max(1.0, float(np.max(np.abs(step[size:]) / _longest(low, high)))))


def _longest(low: Floats, high: Floats) -> Floats:
    """The longest step of each shape number, and the scale over which a lobe changes with it."""
    return np.minimum(LONGEST_STEP, LONGEST_SHARE * (high - low))


def shape_sd(joint: Floats, layout: Layout) -> Floats:
    """Sd of each shape number were everything else known: a yardstick for steps."""
    return np.asarray(1.0 / np.sqrt(np.maximum(joint.diagonal()[layout.size :], 1e-300)))


def misfit_root(chi2: float, counted: int, tempering: float) -> float:
    """Root of the chi-square that noise does not explain."""
    return float(np.sqrt(max(chi2 - (counted + 3.0 * np.sqrt(2.0 * counted)) / tempering, 0.0)))
