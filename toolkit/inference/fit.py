"""Least squares by variable projection: only the shape is searched, everything linear is solved for at each step.

Weights come from the model's own prediction, never from the noisy sample: noise in a weight is correlated with noise
in the datum and biases an albedo by tens of its sd. So: a coarse search with provisional weights, then Gauss-Newton
(Golub & Pereyra 1973) and new weights in turn until both stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, Noise, Scene, scale_of
from toolkit.reflectance.fresnel import TANGENT_F0

from .cells import Cells, ChannelCells
from .model import Columns, Evaluate, Fresnel, Lit, Model, columns, columns_of_many, fresnel_of, lit_by, names_of
from .normal import (
    Layout,
    Normal,
    Prior,
    Sums,
    Weighing,
    bounded,
    combine,
    equations,
    lay_out,
    numbered,
    solve,
    sums_of,
    weigh,
)

Evaluated = tuple[Columns, ...]

GRID = 14  # shapes tried along a single shape number before the descent begins
DESCENTS = 3  # how many of them are descended from
MOST_MINIMA = 2  # how many of the optima found are looked at with the calibration free
STEPS = 25
ROUNDS = 4  # of new weights, at most
STANDS_SD = 0.01  # sds by which new weights may still move the shape
LONGEST_STEP, LONGEST_SHARE = 0.7, 0.25  # a factor of two in a logarithm; of a range
SHORT_OF_BOUND, ONTO_BOUND = 0.1, 0.01  # of the way to a bound that one step leaves; of the range, from where none
PLAIN = 30.0  # chi-square on a few cells by which one optimum is plainly better than another
SEARCH_CELLS = 700  # enough to tell where to begin, few enough to be cheap
TANGENT_STANDS = 0.003  # of F0, by which it may lie beside where its tangent is taken: an error of second order
PEDESTAL_SD = 0.002  # prior of the black level's error, of the signal's 99th percentile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """One photograph: its scene, its samples in cells, its noise."""

    scene: Scene
    cells: Cells
    noise: Noise
    lights: tuple[Lit, ...]  # at the cells' nodes

    @classmethod
    def of(cls, scene: Scene, cells: Cells, noise: Noise) -> View:
        """With the lights worked out at the cells."""
        return cls(scene=scene, cells=cells, noise=noise, lights=lit_by(scene, *cells.nodes()))

    def moved(self, scene: Scene) -> View:
        """The same samples, seen in another scene."""
        return self if scene is self.scene else View.of(scene, self.cells, self.noise)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One model on the cells of one photograph, or of several of one material; three channels of each, in order."""

    model: Model
    views: tuple[View, ...]
    fresnel: Fresnel
    layout: Layout
    prior: Prior
    extras: tuple[Floats, ...]  # per channel (n, q): shared columns such as calibration shifts

    @property
    def channels(self) -> tuple[ChannelCells, ...]:
        """The channels of all photographs."""
        return tuple(data for view in self.views for data in view.cells.channels)

    @property
    def scale(self) -> Literal["absolute", "relative"]:
        """Absolute where one photograph's irradiance is known."""
        return scale_of([view.scene for view in self.views])

    def columns(self, u: Floats, *, derivatives: bool = False, evaluate: Evaluate | None = None) -> Evaluated:
        """The model's columns at one shape."""
        found = [
            columns(self.model, self.fresnel, view.lights, view.cells, u, derivatives=derivatives, evaluate=evaluate)
            for view in self.views
        ]
        return tuple(one for three in found for one in three)

    def assemble(self, cols: tuple[Columns, ...], weights: Weighing, at: Floats | None = None) -> Normal:
        """The normal equations for columns already evaluated; the shape's range counts as its prior's width."""
        return self.combine(sums_of(cols, self.channels, weights), weights, at)

    def combine(self, sums: tuple[Sums, ...], weights: Weighing, at: Floats | None = None) -> Normal:
        """The normal equations from sums over the cells already taken."""
        normal = combine(sums, weights, self.layout, self.prior, at)
        if at is not None:
            low, high = self.model.bounds()
            shapes = np.arange(self.layout.size, len(normal.rhs))
            normal.matrix[shapes, shapes] += 12.0 / (high - low) ** 2
        return normal

    def predict(self, cols: tuple[Columns, ...], x: Floats) -> tuple[Floats, ...]:
        """Radiance per channel on the cells."""
        named = len(self.layout.names)
        return tuple(
            np.asarray(col.matrix @ x[index] + col.offset + extra @ x[named:])
            for col, index, extra in zip(cols, self.layout.index, self.extras, strict=True)
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Where a fit came to rest. `joint` is the normal matrix of linear unknowns, then shape; `u` the shape."""

    problem: Problem
    u: Floats
    x: Floats
    weights: Weighing
    joint: Floats
    chi2: float  # with the prior's part
    on_bound: NDArray[np.bool_]  # linear unknowns, then shape
    status: str


def pose(model: Model, scene: Scene, cells: Cells, noise: Noise) -> Problem:
    """Set up the fit of one photograph."""
    return pose_views(model, [View.of(scene, cells, noise)])


def pose_views(
    model: Model,
    views: Sequence[View],
    *,
    fresnel: Fresnel | None = None,
    extras: tuple[Floats, ...] | None = None,
    extras_precision: Floats | None = None,
    extras_centre: Floats | None = None,
) -> Problem:
    """Set up the fit of several photographs of one material.

    `extras` are further shared columns per channel with their Gaussian prior; `fresnel` how F is known to enter.
    """
    fresnel = fresnel or fresnel_of(model, [view.scene for view in views])
    extras = extras or tuple(np.zeros((len(data.rows), 0)) for view in views for data in view.cells.channels)
    layout = lay_out(names_of(model, fresnel), neutral=model.neutral, extras=extras[0].shape[1], photographs=len(views))
    return Problem(
        model=model,
        views=tuple(views),
        fresnel=fresnel,
        layout=layout,
        prior=_prior(layout, views, extras_precision, extras_centre),
        extras=extras,
    )


def signal_scale(cells: Cells) -> float:
    """The photograph's own radiance scale: 99th percentile of the cells of its brightest channel."""
    return max(float(np.percentile(data.value, 99)) if len(data.value) else 0.0 for data in cells.channels)


def irradiance_scale(scene: Scene) -> float:
    """The mean irradiance of a scene's lights over lights and channels."""
    return max(float(np.mean([lamp.at(np.zeros((1, 3)))[1] for lamp in scene.lights])), 1e-12)


def _prior(
    layout: Layout, views: Sequence[View], extras_precision: Floats | None, extras_centre: Floats | None
) -> Prior:
    """Colours at least 0 with a prior too wide to matter, F0 at most 1, pedestals near 0."""
    signals = {numbered("pedestal", v): max(signal_scale(view.cells), 1e-12) for v, view in enumerate(views)}
    bright = max(signals[numbered("pedestal", v)] / irradiance_scale(view.scene) for v, view in enumerate(views))
    low, high, precision = np.zeros(layout.size), np.full(layout.size, np.inf), np.zeros((layout.size, layout.size))
    for i, (name, _) in enumerate(layout.names):
        precision[i, i] = (PEDESTAL_SD * signals[name] if name in signals else 1e4 * bright) ** -2
        if name in signals:
            low[i] = -np.inf
        if name == "specular_f0":
            high[i] = 1.0
    named = len(layout.names)
    low[named:] = -np.inf
    if extras_precision is not None:
        precision[named:, named:] = extras_precision
    centre = np.zeros(layout.size)
    if extras_centre is not None:
        centre[named:] = extras_centre
    return Prior(precision=precision, centre=centre, low=low, high=high)


def fit(problem: Problem, *, start: Optimum | None = None) -> Optimum:
    """The optimum of a problem; `start`, of a neighbouring problem on the same cells, spares the search."""
    if start is not None:
        return refine(problem, start.u, weigh(start.weights.weights, problem.extras))
    found = _search(problem)
    return min((_begin(problem, few) for few in found if few.chi2 < found[0].chi2 + PLAIN), key=lambda o: o.chi2)


def minima(problem: Problem) -> list[Optimum]:
    """The distinct optima that a search over the whole box comes to rest at, best first, `MOST_MINIMA` at most."""
    return sorted((_begin(problem, few) for few in _search(problem)), key=lambda optimum: optimum.chi2)


def _begin(problem: Problem, few: Optimum) -> Optimum:
    """Go on with all cells from an optimum on a few of them, weighed by what it predicts."""
    problem = replace(problem, fresnel=few.problem.fresnel)
    cols = problem.columns(few.u, derivatives=True)
    x = np.concatenate([few.x, problem.prior.centre[len(few.x) :]])
    return refine(problem, few.u, weights_at(problem, problem.predict(cols, x)), cols)


def refine(problem: Problem, u: Floats, weights: Weighing, cols: Evaluated | None = None) -> Optimum:
    """Descend from a shape, with new weights from the prediction in turn, until both stand.

    `cols` are the columns there with their derivatives, where they are known already.
    """
    here = _descend(problem, u, weights, cols)
    for _ in range(ROUNDS):
        weights, problem = weights_at(problem, here.predicted), _tangent_at(here.optimum)
        if problem is here.optimum.problem and _alike(weights, here.optimum):
            break
        before, here = here, _descend(problem, here.optimum.u, weights)
        u = here.optimum.u
        if problem is before.optimum.problem and (
            len(u) == 0
            or np.all(np.abs(u - before.optimum.u) <= STANDS_SD * _shape_sd(here.optimum.joint, problem.layout))
        ):
            break
    return here.optimum


def _tangent_at(optimum: Optimum) -> Problem:
    """The problem with a dielectric's tangent taken at the F0 that was found; itself where that makes no difference."""
    problem, fresnel = optimum.problem, optimum.problem.fresnel
    if fresnel.choice == "schlick" or fresnel.kind not in ("known", "pair"):
        return problem
    f0 = float(np.clip(np.mean(f0_of(problem, optimum.x)), *TANGENT_F0))
    if abs(f0 - fresnel.f0) <= TANGENT_STANDS * fresnel.f0:
        return problem
    return replace(problem, fresnel=replace(fresnel, f0=f0))


def f0_of(problem: Problem, x: Floats) -> Floats:
    """F0 per channel (..., 3) of linear unknowns (..., P), where the fit has one."""
    if problem.fresnel.kind == "known":
        return problem.layout.of("specular_f0", x)
    scale = np.maximum(problem.layout.of("specular_scale", x), 1e-30)
    return np.asarray(problem.layout.of("specular_scale_f0", x) / scale)


def _alike(weights: Weighing, optimum: Optimum) -> bool:
    """Whether new weights could not move the optimum by more than STANDS_SD.

    By Cauchy and Schwarz weights changed by a share e move it by at most e sds of the noise's part of the residuals,
    and by e times the root of the chi-square that is not noise.
    """
    change, cells = 0.0, 0
    for new, old in zip(weights.weights, optimum.weights.weights, strict=True):
        counted = old > 0.0
        if np.any((new > 0.0) != counted):
            return False
        change += float(np.sum((new[counted] / old[counted] - 1.0) ** 2))
        cells += int(np.count_nonzero(counted))
    return float(np.sqrt(change / max(cells, 1))) * (1.0 + _misfit(optimum.chi2, cells)) <= STANDS_SD


def _misfit(chi2: float, cells: int) -> float:
    """Root of the chi-square that noise does not explain."""
    return float(np.sqrt(max(chi2 - cells - 3.0 * np.sqrt(2.0 * cells), 0.0)))


def _search(problem: Problem) -> list[Optimum]:
    """Optima on a few of the cells: where descents from the best of a coarse grid end, best first, far apart."""
    few = pose_views(problem.model, [_thinned(view) for view in problem.views], fresnel=problem.fresnel)
    weights = _provisional(few)
    if not problem.model.parameters:
        return [refine(few, np.zeros(0), weights)]
    apart = 0.1 * np.subtract(*problem.model.bounds()[::-1])
    found = [refine(few, u, weights) for u in _starts(few, weights, apart)[:DESCENTS]]
    found.sort(key=lambda optimum: optimum.chi2)
    kept = _far_apart([optimum.u for optimum in found], apart)[:MOST_MINIMA]
    return [optimum for optimum in found if any(optimum.u is u for u in kept)]


def _thinned(view: View) -> View:
    cells = view.cells.thinned(max(len(view.cells.x_px) // SEARCH_CELLS, 1))
    return View.of(view.scene, cells, view.noise)


def _starts(problem: Problem, weights: Weighing, apart: Floats) -> list[Floats]:
    """Where to descend from, best first: along a single number the valleys of the grid, else its best points."""
    grid = np.array(_grid(problem.model))
    chi2 = np.concatenate([_chi2_of(problem, part, weights) for part in np.array_split(grid, -(-len(grid) // GRID))])
    order = np.argsort(chi2, kind="stable")
    if grid.shape[1] > 1:
        return _far_apart(list(grid[order]), apart)
    walled = np.concatenate([[np.inf], chi2, [np.inf]])
    valley = (chi2 <= walled[:-2]) & (chi2 <= walled[2:])
    return [_bottom(grid[:, 0], chi2, i) for i in order if valley[i]]


def _bottom(u: Floats, chi2: Floats, i: int) -> Floats:
    """The lowest point of the parabola through a point of the grid and its neighbours."""
    if i in (0, len(u) - 1):
        return u[i : i + 1]
    left, right = chi2[i - 1] - chi2[i], chi2[i + 1] - chi2[i]
    return np.asarray(u[i : i + 1] + 0.5 * (u[i + 1] - u[i]) * (left - right) / max(left + right, 1e-300))


def _chi2_of(problem: Problem, shapes: Floats, weights: Weighing) -> Floats:
    """Chi-square at several shapes (S, D) at once, of a problem without extra columns."""
    found = [columns_of_many(problem.model, problem.fresnel, view.lights, view.cells, shapes) for view in problem.views]
    cols = tuple(one for three in found for one in three)
    matrix, rhs, squares = equations(sums_of(cols, problem.channels, weights), problem.layout, problem.prior)
    best = [bounded(m, r, problem.prior)[0] for m, r in zip(matrix, rhs, strict=True)]
    return np.array([s + x @ m @ x - 2 * x @ r for s, x, m, r in zip(squares, best, matrix, rhs, strict=True)])


def _far_apart(shapes: list[Floats], apart: Floats) -> list[Floats]:
    """Those, in order, that are not close to one before them."""
    kept: list[Floats] = []
    for u in shapes:
        if all(np.any(np.abs(u - v) > apart) for v in kept):
            kept.append(u)
    return kept


def _grid(model: Model) -> list[Floats]:
    """Shapes spread over the box: evenly along a single number, else the products of the lobes' own starts."""
    low, high = model.bounds()
    if len(low) == 1:
        return [np.array([v]) for v in np.linspace(low[0], high[0], GRID + 2)[1:-1]]
    starts = [[np.log(s) if p.log else s for s in p.starts] for p in model.parameters]
    return [np.array(point) for point in product(*starts)]


def _shape_sd(joint: Floats, layout: Layout) -> Floats:
    """Sd of each shape number were everything else known: a yardstick for steps."""
    return np.asarray(1.0 / np.sqrt(np.maximum(joint.diagonal()[layout.size :], 1e-300)))


def _provisional(problem: Problem) -> Weighing:
    """Weights before there is a prediction; clipped cells wait until there is one."""
    return weights_at(problem, tuple(data.value for data in problem.channels))


def weights_at(problem: Problem, predicted: tuple[Floats, ...]) -> Weighing:
    """One over the variance of each cell's mean at the predicted radiance; none where a clipped one is reached."""
    weights = tuple(
        np.where(data.censored & (signal >= data.value), 0.0, data.count / noise.variance(signal, c))
        for (noise, c, data), signal in zip(
            ((view.noise, c, data) for view in problem.views for c, data in enumerate(view.cells.channels)),
            predicted,
            strict=True,
        )
    )
    return weigh(weights, problem.extras)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rest:
    """Where a descent ended, and what is predicted there (n,) per channel."""

    optimum: Optimum
    predicted: tuple[Floats, ...]


def _descend(problem: Problem, u: Floats, weights: Weighing, cols: Evaluated | None = None) -> _Rest:
    """Gauss-Newton in the shape with everything else projected out; shorter steps where one would climb."""
    low, high = problem.model.bounds()
    inside = ONTO_BOUND * (high - low)
    within = np.clip(u, low + inside, high - inside)  # a lobe's slope may be 0 on a bound
    here = _project(problem, within, weights, cols if np.array_equal(within, u) else None)
    status, cells = f"not converged after {STEPS} steps", sum(int(np.count_nonzero(w)) for w in weights.weights)
    last: Floats = np.zeros(len(here.joint.rhs))
    for _ in range(STEPS):
        u, step = here.u, _joint_step(here, low, high)
        near, far = _reach(u, low, high)
        moved = step[problem.layout.size :]
        sd = _shape_sd(here.joint.matrix, problem.layout)
        wanted = np.clip(u + moved, near, far) - u
        if _lands(here, step, wanted, sd, cells):
            status, last = "converged", step
            break
        if np.all(np.abs(wanted) <= np.maximum(STANDS_SD * sd, 1e-9)):
            status = "converged"
            break
        for factor in (1.0, 0.4, 0.15, 0.05, 0.01, 0.001):
            there = _project(problem, np.clip(u + factor * moved, near, far), weights)
            if there.chi2 < here.chi2:
                break
        else:  # nothing lower along the step: as good as it gets
            status = "converged"
            break
        here = there
    return _rest(here, last, weights, status)


def _lands(here: _Projection, step: Floats, wanted: Floats, sd: Floats, cells: int) -> bool:
    """Whether a step is so short that its end needs no second look: linear there to STANDS_SD, nothing at a bound.

    A step s along a scale L (a longest step) errs by s^2 / L, and by s sd / L for each sd of misfit.
    """
    problem = here.problem
    x, moved = here.x + step[: len(here.x)], step[len(here.x) :]
    if here.on_bound.any() or len(moved) == 0 or np.any(np.abs(moved - wanted) > 1e-9 * np.abs(moved) + 1e-15):
        return False
    if np.any((x < problem.prior.low) | (x > problem.prior.high)):
        return False
    longest = _longest(*problem.model.bounds())
    error = np.abs(moved) * (np.abs(moved) + sd * (1.0 + _misfit(here.chi2, cells))) / longest
    return bool(np.all(error <= STANDS_SD * sd))


def _rest(here: _Projection, step: Floats, weights: Weighing, status: str) -> _Rest:
    """The end of a descent, after a last `step` of linear unknowns and shape."""
    problem, size = here.problem, len(here.x)
    low, high = problem.model.bounds()
    u, x, drop = here.u, here.x, 0.0
    predicted = problem.predict(here.columns, x)
    if step.any():
        u, x, drop = u + step[size:], x + step[:size], float(step @ here.joint.rhs)
        slopes = [
            c.table[1:, 0] + np.einsum("dkn,k->dn", c.table[1:, 1:], here.x[i])
            for c, i in zip(here.columns, problem.layout.index, strict=True)
        ]
        predicted = tuple(p + step[size:] @ s for p, s in zip(problem.predict(here.columns, x), slopes, strict=True))
    optimum = Optimum(
        problem=problem,
        u=u,
        x=x,
        weights=weights,
        joint=here.joint.matrix,
        chi2=here.chi2 - drop,
        on_bound=np.concatenate([here.on_bound, (u <= low + 1e-9) | (u >= high - 1e-9)]),
        status=status,
    )
    return _Rest(optimum=optimum, predicted=predicted)


def _reach(u: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """How far one step may go: most of the way to a bound, onto it only from close by.

    A long step that ends on a bound can stay there for good: at roughness 0 Oren-Nayar's slope in it is 0.
    """
    close = ONTO_BOUND * (high - low)
    near = np.where(u - low > close, low + SHORT_OF_BOUND * (u - low), low)
    far = np.where(high - u > close, high - SHORT_OF_BOUND * (high - u), high)
    return near, far


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Projection:
    """A shape with everything linear solved for, and the joint equations of the step from there."""

    problem: Problem
    u: Floats
    columns: Evaluated
    x: Floats
    chi2: float
    on_bound: NDArray[np.bool_]
    joint: Normal


def _project(problem: Problem, u: Floats, weights: Weighing, cols: Evaluated | None = None) -> _Projection:
    cols = problem.columns(u, derivatives=True) if cols is None else cols
    sums = sums_of(cols, problem.channels, weights)
    normal = problem.combine(sums, weights)
    x, on_bound = bounded(normal.matrix, normal.rhs, problem.prior)
    chi2 = normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs)
    joint = problem.combine(sums, weights, x)
    return _Projection(problem=problem, u=u, columns=cols, x=x, chi2=chi2, on_bound=on_bound, joint=joint)


def chi2_at(problem: Problem, u: Floats, weights: Weighing) -> float:
    """Chi-square at one shape, everything linear solved for; the prior's part counts."""
    normal = problem.assemble(problem.columns(u), weights)
    x, _ = bounded(normal.matrix, normal.rhs, problem.prior)
    return normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs)


def _joint_step(here: _Projection, low: Floats, high: Floats) -> Floats:
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
