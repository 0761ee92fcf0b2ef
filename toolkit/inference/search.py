"""Where to begin: a coarse look over the whole box of shapes, on a few of the cells."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from toolkit.records import Floats

from .columns import columns_of_many
from .descend import chi2_at
from .model import Model
from .normal import Weighing, equations, sums_of
from .problem import Evaluated, Optimum, Problem, weighing_at
from .refine import refine
from .solving import bounded_each

GRID = 16  # shapes tried along a single shape number, its range's ends among them, before the descent begins
DESCENTS = 3  # how many of them are descended from
WAY = 8  # looks on the way from a start to an end
MOST_MINIMA = 2  # how many of the optima found are gone on with
LANDS_SD = 0.3  # sds of so few cells by which a descent may end beside its optimum: their noise puts that further off
ALIKE_SD = 0.1  # that weights from a prediction may make of it: noise of such a share in weights biases by its square
SEARCH_CELLS = 700  # enough to tell where to begin, few enough to be cheap


def thinned(problem: Problem) -> Problem:
    """The same on the means of some `SEARCH_CELLS` of each photograph's cells, without further columns."""
    return problem.seen_in(view.thinned(every) for view, every in zip(problem.views, strides(problem), strict=True))


def strides(problem: Problem) -> list[int]:
    """Of each photograph's cells one in so many is kept."""
    return [max(len(view.cells.x_px) // SEARCH_CELLS, 1) for view in problem.views]


def search(few: Problem) -> list[Optimum]:
    """Where descents from the best of a coarse grid end, best first, far apart: meant for a problem of few cells."""
    weights = _provisional(few)
    if not few.model.parameters:
        return [refine(few, np.zeros(0), weights)]
    apart = 0.1 * np.subtract(*few.model.bounds()[::-1])
    middles = few.seen_in(view.middles() for view in few.views)
    found: list[Optimum] = []
    for u in _starts(middles, weights, apart)[:DESCENTS]:
        if not (_by_lines(few.model) and any(_leads_down(middles, u, end.u, weights) for end in found)):
            found.append(refine(few, u, weights, lands_sd=LANDS_SD, alike_sd=ALIKE_SD))
    found.sort(key=lambda optimum: optimum.chi2)
    kept = _far_apart([optimum.u for optimum in found], apart)[:MOST_MINIMA]
    return [optimum for optimum in found if any(optimum.u is u for u in kept)]


def beside(best: Optimum) -> list[Optimum]:
    """Descents from other valleys of the lines through an optimum along each of its shape numbers.

    With a problem's extra columns, as they are at the optimum: what a calibration takes up can hide a valley from a
    search without it. Those count that look no worse on the line's few points than the optimum's own valley does.
    """
    low, high = best.problem.model.bounds()
    apart, found = 0.1 * (high - low), []
    middles = replace(best.problem, views=tuple(view.middles() for view in best.problem.views))
    for d in range(len(best.u)):
        line = np.repeat(best.u[None], GRID, axis=0)
        line[:, d] = np.linspace(low[d], high[d], GRID)
        chi2 = _chi2_sided(middles, line, best.weights)
        own = np.min(chi2[np.abs(line[:, d] - best.u[d]) <= line[1, d] - line[0, d]])
        found += [u for fits, u in _valleys(line, chi2) if fits <= own]
    return [refine(best.problem, u, best.weights) for u in _far_apart([best.u, *found], apart)[1:]]


def _leads_down(problem: Problem, start: Floats, end: Floats, weights: Weighing) -> bool:
    """Whether chi-square falls all the straight way to the end of a descent, which another from here would find."""
    way = start + np.linspace(0.0, 1.0, WAY)[:, None] * (end - start)
    return bool((np.diff(_chi2_of(problem, way, weights)) <= 0.0).all())


def _starts(problem: Problem, weights: Weighing, apart: Floats) -> list[Floats]:
    """Where to descend from, best first: the valleys of lines along a highlight's one number, else a grid's points."""
    grid = np.array(_grid(problem.model))
    rows = grid.reshape(-1, grid.shape[-1])
    chi2 = np.concatenate([_chi2_of(problem, part, weights) for part in np.array_split(rows, -(-len(rows) // GRID))])
    found = [
        start for line, fits in zip(grid, chi2.reshape(grid.shape[:2]), strict=True) for start in _valleys(line, fits)
    ]
    return _far_apart([u for _, u in sorted(found, key=lambda start: start[0])], apart)


def _valleys(line: Floats, chi2: Floats) -> list[tuple[float, Floats]]:
    """The chi-squares and places (D,) that are lowest among their neighbours along a line of shapes (n, D)."""
    walled = np.concatenate([[np.inf], chi2, [np.inf]])
    valley = (chi2 <= walled[:-2]) & (chi2 <= walled[2:])
    return [(float(chi2[i]), _bottom(line, chi2, i)) for i in range(len(line)) if valley[i]]


def _bottom(u: Floats, chi2: Floats, i: int) -> Floats:
    """The lowest point of the parabola through a point of a line and its neighbours."""
    if i in (0, len(u) - 1):
        return np.asarray(u[i])
    left, right = chi2[i - 1] - chi2[i], chi2[i + 1] - chi2[i]
    return np.asarray(u[i] + 0.5 * (u[i + 1] - u[i]) * (left - right) / max(left + right, 1e-300))


def _chi2_of(problem: Problem, shapes: Floats, weights: Weighing) -> Floats:
    """Chi-square at several shapes (S, D) at once; of clipped data those count that have weights."""
    cols = _columns_of(problem, shapes)
    sums = tuple(one.mixed(col.mix[0]) for one, col in zip(sums_of(cols, problem.channels, weights), cols, strict=True))
    matrix, rhs, squares = equations(sums, problem.layout, problem.prior, weights.gram)
    best = bounded_each(matrix, rhs, problem.prior)
    return np.asarray(squares + np.sum(best * ((matrix @ best[..., None])[..., 0] - 2.0 * rhs), axis=-1))


def _chi2_sided(problem: Problem, shapes: Floats, weights: Weighing) -> Floats:
    """The same where of clipped data at each shape those count that its prediction falls short of."""
    if not any(len(w.clipped) for w in weights.weights):
        return _chi2_of(problem, shapes, weights)
    cols = _columns_of(problem, shapes)
    each = (tuple(replace(col, rows=col.rows[i]) for col in cols) for i in range(len(shapes)))
    return np.array([chi2_at(problem, one, weights) for one in each])


def _columns_of(problem: Problem, shapes: Floats) -> Evaluated:
    found = [columns_of_many(problem.model, problem.fresnel, view.lights, view.cells, shapes) for view in problem.views]
    return tuple(one for three in found for one in three)


def _far_apart(shapes: list[Floats], apart: Floats) -> list[Floats]:
    """Those, in order, that are not close to one before them."""
    kept: list[Floats] = []
    for u in shapes:
        if all(np.any(np.abs(u - v) > apart) for v in kept):
            kept.append(u)
    return kept


def _by_lines(model: Model) -> bool:
    """Whether a start is the bottom of a valley, and not a point of a coarse grid, where a descent may be stuck."""
    return len(model.specular.parameters) == 1


def _grid(model: Model) -> list[list[Floats]]:
    """Lines of shapes over the box: evenly along a highlight's one number, at each start of the body's; else points.

    With a highlight far from its place, a body's number takes up what it can and ends where it is told nothing.
    """
    low, high = model.bounds()
    starts = [[np.log(s) if p.log else s for s in p.starts] for p in model.parameters]
    if not _by_lines(model):
        return [[np.array(point)] for point in product(*starts)]
    line = np.linspace(low[0], high[0], GRID)
    return [[np.array([u, *body]) for u in line] for body in product(*starts[1:])]


def _provisional(problem: Problem) -> Weighing:
    """Weights before there is a prediction; clipped cells wait until there is one."""
    return weighing_at(problem, tuple(data.value for data in problem.channels))
