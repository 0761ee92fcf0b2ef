"""Least squares by variable projection: only the shape is searched, everything linear is solved for at each step.

Weights come from the model's own prediction, never from the noisy sample: noise in a weight is correlated with noise
in the datum and biases an albedo by tens of its sd. So: a coarse search with provisional weights, then Gauss-Newton
(Golub & Pereyra 1973) and new weights in turn until both stand.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, Noise, Scene

from .cells import Cells
from .model import Columns, Fresnel, Lit, Model, columns, fresnel_of, lit_by, names_of
from .normal import Layout, Normal, Prior, Weighing, assemble, bounded, lay_out, solve, weigh

GRID = 14  # shapes tried along a single shape number before the descent begins
DESCENTS = 3  # how many of them are descended from
MOST_MINIMA = 2  # how many of the optima found are looked at with the calibration free
STEPS = 25
ROUNDS = 4  # of new weights, at most
STANDS_SD = 0.01  # sds by which new weights may still move the shape
LONGEST_STEP, LONGEST_SHARE = 0.7, 0.25  # a factor of two in a logarithm; of a range
SHORT_OF_BOUND, ONTO_BOUND = 0.1, 0.01  # of the way to a bound that one step leaves; of the range, from where none
SEARCH_CELLS = 2500  # enough to tell where to begin, few enough to be cheap
PEDESTAL_SD = 0.002  # prior of the black level's error, of the signal's 99th percentile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One model on one photograph's cells."""

    model: Model
    scene: Scene
    fresnel: Fresnel
    cells: Cells
    lights: tuple[Lit, ...]  # at the cells' nodes
    noise: Noise
    layout: Layout
    prior: Prior
    extras: tuple[Floats, ...]  # per channel (n, q): shared columns such as calibration shifts

    def columns(self, u: Floats, *, derivatives: bool = False) -> tuple[Columns, Columns, Columns]:
        """The model's columns at one shape."""
        return columns(self.model, self.fresnel, self.lights, self.cells, u, derivatives=derivatives)

    def assemble(self, cols: tuple[Columns, ...], weights: Weighing, at: Floats | None = None) -> Normal:
        """The normal equations for columns already evaluated; the shape's range counts as its prior's width."""
        normal = assemble(cols, self.cells, weights, self.layout, self.prior, self.extras, at)
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


def pose(
    model: Model,
    scene: Scene,
    cells: Cells,
    noise: Noise,
    *,
    extras: tuple[Floats, ...] | None = None,
    extras_precision: Floats | None = None,
    extras_centre: Floats | None = None,
) -> Problem:
    """Set up a fit. `extras` are further shared columns per channel with their Gaussian prior."""
    fresnel = fresnel_of(model, scene)
    extras = extras or tuple(np.zeros((len(data.rows), 0)) for data in cells.channels)
    layout = lay_out(names_of(model, fresnel), neutral=model.neutral, extras=extras[0].shape[1])
    return Problem(
        model=model,
        scene=scene,
        fresnel=fresnel,
        cells=cells,
        lights=lit_by(scene, *cells.nodes()),
        noise=noise,
        layout=layout,
        prior=_prior(layout, cells, scene, extras_precision, extras_centre),
        extras=extras,
    )


def signal_scale(cells: Cells) -> float:
    """The photograph's own radiance scale: 99th percentile of the cells of its brightest channel."""
    return max(float(np.percentile(data.value, 99)) if len(data.value) else 0.0 for data in cells.channels)


def _prior(
    layout: Layout, cells: Cells, scene: Scene, extras_precision: Floats | None, extras_centre: Floats | None
) -> Prior:
    """Colours at least 0 with a prior too wide to matter, F0 at most 1, a pedestal near 0."""
    signal = max(signal_scale(cells), 1e-12)
    light = max(float(np.mean([lamp.at(np.zeros((1, 3)))[1] for lamp in scene.lights])), 1e-12)
    low, high, precision = np.zeros(layout.size), np.full(layout.size, np.inf), np.zeros((layout.size, layout.size))
    for i, (name, _) in enumerate(layout.names):
        sd = PEDESTAL_SD * signal if name == "pedestal" else 1e4 * signal / light
        precision[i, i] = sd**-2
        if name == "pedestal":
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
    if start is None:
        return minima(problem)[0]
    return refine(problem, start.u, weigh(start.weights.weights, problem.extras))


def minima(problem: Problem) -> list[Optimum]:
    """The distinct optima that a search over the whole box comes to rest at, best first, `MOST_MINIMA` at most."""
    weights = _provisional(problem)
    found = [refine(problem, u, weights) for u in _search(problem)]
    return sorted(found, key=lambda optimum: optimum.chi2)


def refine(problem: Problem, u: Floats, weights: Weighing) -> Optimum:
    """Descend from a shape, with new weights from the prediction in turn, until both stand."""
    here = _descend(problem, u, weights)
    for _ in range(ROUNDS):
        predicted = problem.predict(problem.columns(here.u), here.x)
        before, here = here, _descend(problem, here.u, weights_at(problem, predicted))
        if len(here.u) == 0 or np.all(np.abs(here.u - before.u) <= STANDS_SD * _shape_sd(here.joint, problem)):
            break
    return here


def _search(problem: Problem) -> list[Floats]:
    """Shapes to begin from: where descents from the best of a coarse grid end, on a few of the cells."""
    if not problem.model.parameters:
        return [np.zeros(0)]
    cells = problem.cells.thinned(max(len(problem.cells.x_px) // SEARCH_CELLS, 1))
    few = pose(problem.model, problem.scene, cells, problem.noise)
    weights = _provisional(few)
    tried = []
    for u in _grid(problem.model):
        normal = few.assemble(few.columns(u), weights)
        x, _ = bounded(normal.matrix, normal.rhs, few.prior)
        tried.append((normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs), u))
    tried.sort(key=lambda pair: pair[0])
    apart = 0.1 * np.subtract(*problem.model.bounds()[::-1])
    found = [_descend(few, u, weights) for u in _far_apart([u for _, u in tried], apart)[:DESCENTS]]
    found.sort(key=lambda optimum: optimum.chi2)
    return _far_apart([optimum.u for optimum in found], apart)[:MOST_MINIMA]


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


def _shape_sd(joint: Floats, problem: Problem) -> Floats:
    """Sd of each shape number were everything else known: a yardstick for steps."""
    return np.asarray(1.0 / np.sqrt(np.maximum(np.diag(joint)[problem.layout.size :], 1e-300)))


def _provisional(problem: Problem) -> Weighing:
    """Weights before there is a prediction; clipped cells wait until there is one."""
    return weights_at(problem, tuple(data.value for data in problem.cells.channels))


def weights_at(problem: Problem, predicted: tuple[Floats, ...]) -> Weighing:
    """One over the variance of each cell's mean at the predicted radiance; none where a clipped one is reached."""
    weights = tuple(
        np.where(data.censored & (signal >= data.value), 0.0, data.count / problem.noise.variance(signal, c))
        for c, (data, signal) in enumerate(zip(problem.cells.channels, predicted, strict=True))
    )
    return weigh(weights, problem.extras)


def _descend(problem: Problem, u: Floats, weights: Weighing) -> Optimum:
    """Gauss-Newton in the shape with everything else projected out; shorter steps where one would climb."""
    low, high = problem.model.bounds()
    inside = ONTO_BOUND * (high - low)
    u = np.clip(u, low + inside, high - inside)  # a lobe's slope may be 0 on a bound
    here = _project(problem, u, weights)
    status = f"not converged after {STEPS} steps"
    joint = problem.assemble(here.columns, weights, here.x)
    for _ in range(STEPS):
        step = _shape_step(joint, here.on_bound, u, low, high)
        near, far = _reach(u, low, high)
        wanted = np.clip(u + step, near, far) - u
        if np.all(np.abs(wanted) <= np.maximum(STANDS_SD * _shape_sd(joint.matrix, problem), 1e-9)):
            status = "converged"
            break
        for factor in (1.0, 0.4, 0.15, 0.05, 0.01, 0.001):
            there = _project(problem, np.clip(u + factor * step, near, far), weights)
            if there.chi2 < here.chi2:
                break
        else:  # nothing lower along the step: as good as it gets
            status = "converged"
            break
        u, here = np.clip(u + factor * step, near, far), there
        joint = problem.assemble(here.columns, weights, here.x)
    resting = np.concatenate([here.on_bound, (u <= low + 1e-9) | (u >= high - 1e-9)])
    return Optimum(
        problem=problem,
        u=u,
        x=here.x,
        weights=weights,
        joint=joint.matrix,
        chi2=here.chi2,
        on_bound=resting,
        status=status,
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
class _Projection:
    columns: tuple[Columns, Columns, Columns]
    x: Floats
    chi2: float
    on_bound: NDArray[np.bool_]


def _project(problem: Problem, u: Floats, weights: Weighing) -> _Projection:
    cols = problem.columns(u, derivatives=True)
    normal = problem.assemble(cols, weights)
    x, on_bound = bounded(normal.matrix, normal.rhs, problem.prior)
    chi2 = normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs)
    return _Projection(columns=cols, x=x, chi2=chi2, on_bound=on_bound)


def chi2_at(problem: Problem, u: Floats, weights: Weighing) -> float:
    """Chi-square at one shape, everything linear solved for; the prior's part counts."""
    return _project(problem, u, weights).chi2


def _shape_step(joint: Normal, on_bound: NDArray[np.bool_], u: Floats, low: Floats, high: Floats) -> Floats:
    """The Gauss-Newton step of the shape, what rests on a bound held there, shortened as a whole where it is long."""
    size = len(on_bound)
    if len(u) == 0:
        return np.zeros(0)
    pinned = ((u <= low) & (joint.rhs[size:] < 0)) | ((u >= high) & (joint.rhs[size:] > 0))
    free = np.concatenate([~on_bound, ~pinned])
    step = np.zeros(len(joint.rhs))
    damped = joint.matrix[np.ix_(free, free)] * (1.0 + 1e-9 * np.eye(int(free.sum())))
    step[free] = solve(damped, joint.rhs[free])
    longest = np.minimum(LONGEST_STEP, LONGEST_SHARE * (high - low))
    return np.asarray(step[size:] / max(1.0, float(np.max(np.abs(step[size:]) / longest))))
