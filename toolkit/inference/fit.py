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
from .normal import Layout, Normal, Prior, assemble, bounded, lay_out, solve

GRID = 14  # shapes tried along a single shape number before the descent begins
DESCENTS = 2  # how many of them are descended from
STEPS = 25
ROUNDS = 3  # of new weights
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

    def assemble(self, cols: tuple[Columns, ...], weights: tuple[Floats, ...], at: Floats | None = None) -> Normal:
        """The normal equations for columns already evaluated."""
        return assemble(cols, self.cells, weights, self.layout, self.prior, self.extras, at)

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
    weights: tuple[Floats, ...]
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


def fit(problem: Problem, *, start: Floats | None = None) -> Optimum:
    """The optimum of a problem; `start` spares the search where a neighbouring optimum is known."""
    weights = _weights(problem, tuple(data.value for data in problem.cells.channels))
    best: Optimum | None = None
    starts = [start] if start is not None else _search(problem, weights)
    for u in starts:
        found = _descend(problem, u, weights)
        if best is None or found.chi2 < best.chi2:
            best = found
    if best is None:
        raise ValueError("a fit needs at least one start")
    for _ in range(ROUNDS):
        predicted = problem.predict(problem.columns(best.u), best.x)
        best = _descend(problem, best.u, _weights(problem, predicted))
    return best


def _weights(problem: Problem, predicted: tuple[Floats, ...]) -> tuple[Floats, ...]:
    """One over the variance of each cell's mean at the predicted radiance."""
    return tuple(
        data.count / problem.noise.variance(signal, c)
        for c, (data, signal) in enumerate(zip(problem.cells.channels, predicted, strict=True))
    )


def _search(problem: Problem, weights: tuple[Floats, ...]) -> list[Floats]:
    """The most promising shapes of a coarse grid, best first."""
    parameters = problem.model.parameters
    low, high = problem.model.bounds()
    if not parameters:
        return [np.zeros(0)]
    if len(parameters) == 1:
        grid = [np.linspace(low[0], high[0], GRID + 2)[1:-1]]
    else:
        grid = [np.array([np.log(s) if p.log else s for s in p.starts]) for p in parameters]
    tried = []
    for point in product(*grid):
        u = np.array(point)
        normal = problem.assemble(problem.columns(u), weights)
        x, _ = bounded(normal.matrix, normal.rhs, problem.prior)
        tried.append((normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs), u))
    tried.sort(key=lambda pair: pair[0])
    return [u for _, u in tried[:DESCENTS]]


def _descend(problem: Problem, u: Floats, weights: tuple[Floats, ...]) -> Optimum:
    """Gauss-Newton in the shape with everything else projected out; halved steps where one would climb."""
    low, high = problem.model.bounds()
    u = np.clip(u, low, high)
    here = _project(problem, u, weights)
    status = f"not converged after {STEPS} steps"
    for _ in range(STEPS):
        joint = problem.assemble(here.columns, weights, here.x)
        step = _shape_step(joint, here.on_bound, u, low, high)
        if not len(step):
            status = "converged"
            break
        sd = 1.0 / np.sqrt(np.maximum(np.diag(joint.matrix)[problem.layout.size :], 1e-300))
        factor, there, v = 1.0, here, u
        while factor > 1e-4:
            v = np.clip(u + factor * step, low, high)
            there = _project(problem, v, weights)
            if there.chi2 <= here.chi2 + 1e-9 * abs(here.chi2):
                break
            factor *= 0.4
        small = bool(np.all(np.abs(v - u) <= np.maximum(1e-3 * sd, 1e-9)))
        if there.chi2 <= here.chi2 + 1e-9 * abs(here.chi2):
            u, here = v, there
        if small or factor <= 1e-4:
            status = "converged"
            break
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Projection:
    columns: tuple[Columns, Columns, Columns]
    x: Floats
    chi2: float
    on_bound: NDArray[np.bool_]


def _project(problem: Problem, u: Floats, weights: tuple[Floats, ...]) -> _Projection:
    cols = problem.columns(u, derivatives=True)
    normal = problem.assemble(cols, weights)
    x, on_bound = bounded(normal.matrix, normal.rhs, problem.prior)
    chi2 = normal.squares + float(x @ normal.matrix @ x - 2 * x @ normal.rhs)
    return _Projection(columns=cols, x=x, chi2=chi2, on_bound=on_bound)


def _shape_step(joint: Normal, on_bound: NDArray[np.bool_], u: Floats, low: Floats, high: Floats) -> Floats:
    """The Gauss-Newton step of the shape, what rests on a bound held there, limited to a factor of two."""
    size = len(on_bound)
    if len(u) == 0:
        return np.zeros(0)
    pinned = ((u <= low) & (joint.rhs[size:] < 0)) | ((u >= high) & (joint.rhs[size:] > 0))
    free = np.concatenate([~on_bound, ~pinned])
    step = np.zeros(len(joint.rhs))
    damped = joint.matrix[np.ix_(free, free)] * (1.0 + 1e-9 * np.eye(int(free.sum())))
    step[free] = solve(damped, joint.rhs[free])
    return np.clip(step[size:], -0.7, 0.7)
