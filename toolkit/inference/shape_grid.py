"""Everything linear solved for on a grid of shapes, with each lobe evaluated at its own shapes only.

A model's columns are the body lobe's, which depends on its own shape numbers alone, and the highlight's, which depend
on theirs. On a grid of m x n shapes of the two there are m + n tables of columns, and the normal equations of all m n
shapes are sums of products of two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from toolkit.records import Floats

from .cells import ChannelCells
from .columns import Columns, bodies_of_many, highlights_of_many
from .normal import Sums, equations
from .problem import Evaluated, Optimum
from .solving import scaled_each
from .weights import Weights

AT_ONCE = 2**20  # numbers in a table of a lobe at several shapes
MOST_NUMBERS = 2**23  # in the matrices that are worked on at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """At shapes (...): log density with the linear unknowns integrated out, their means (..., P), and the lower
    triangles (..., P (P + 1) / 2) of the Cholesky factors of their covariance, row by row.
    """

    density: Floats
    mean: Floats
    factor: Floats


def solved_on_grid(optimum: Optimum, axes: Floats) -> Solved:
    """The answers at every combination of the values `axes` (D, n) of the shape numbers, (n,) * D of them.

    Raises LinAlgError where the equations have no one answer.
    """
    problem = optimum.problem
    sums = [one for v in range(len(problem.views)) for one in _sums_of(optimum, v, axes)]
    few = max(MOST_NUMBERS // problem.layout.size**2, 1)
    parts = []
    for first in range(0, len(sums[0].data), few):
        some = tuple(one.part(slice(first, first + few)) for one in sums)
        parts.append(_solved(optimum, *equations(some, problem.layout, problem.prior, optimum.weights.gram)))
    grid = axes.shape[1:] * len(axes)
    density, mean, factor = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("density", "mean", "factor")
    )
    return Solved(density=density.reshape(grid), mean=mean.reshape(*grid, -1), factor=factor.reshape(*grid, -1))


def _solved(optimum: Optimum, matrix: Floats, rhs: Floats, squares: Floats) -> Solved:
    """Of normal equations (g, P, P), (g, P), and the squares (g,)."""
    scaled, scale = scaled_each(matrix)
    across = scale[..., :, None] * scale[..., None, :]
    mean = np.linalg.solve(scaled, (rhs * scale)[..., None])[..., 0] * scale
    chi2 = squares - np.sum(mean * rhs, axis=-1)
    log_determinant = np.linalg.slogdet(scaled)[1] - 2.0 * np.sum(np.log(scale), axis=-1)
    return Solved(
        density=-0.5 * (chi2 - optimum.chi2) - 0.5 * log_determinant,
        mean=mean,
        factor=np.linalg.cholesky(np.linalg.inv(scaled) * across)[:, *np.tril_indices(matrix.shape[-1])],
    )


def _sums_of(optimum: Optimum, photograph: int, axes: Floats) -> list[Sums]:
    """Of one photograph's three channels, at all shapes of the grid one after the other (g, ...)."""
    problem, view, first = optimum.problem, optimum.problem.views[photograph], 3 * photograph
    numbers, sharp = view.cells.node_x_px.size * len(view.lights), len(problem.model.specular.parameters)

    def told(of: Callable[..., Evaluated], axes: Floats) -> list[Evaluated]:
        """The columns of one lobe at all combinations of its numbers, in parts."""
        shapes = np.array(list(product(*axes)))
        parts = np.array_split(shapes, min(-(-len(shapes) * numbers // AT_ONCE), len(shapes)))
        return [of(problem.model, problem.fresnel, view.lights, view.cells, part) for part in parts]

    shine, matte = told(highlights_of_many, axes[:sharp]), told(bodies_of_many, axes[sharp:])
    weights, extras = optimum.weights.weights[first : first + 3], problem.extras[first : first + 3]
    return [
        _sums([part[c] for part in shine], [part[c] for part in matte], data, weights[c], extras[c])
        for c, data in enumerate(view.cells.channels)
    ]


def _sums(shine: Sequence[Columns], matte: Sequence[Columns], data: ChannelCells, w: Weights, extras: Floats) -> Sums:
    """One channel's sums at all m b shapes: of the highlight's m, in parts (..., g + 1, n), and the body's b, in parts
    (..., 2, n).

    The last row of either is the pedestal's; `extras` (n, q) are the extra columns.
    """
    bodies = np.concatenate([part.rows[:, 0] for part in matte])
    still = np.concatenate([bodies, matte[0].rows[0, 1:], data.value[None], extras.T])
    products = np.concatenate([_products(part.rows[:, :-1], still, w) for part in shine])
    gloss = products.shape[-1] - len(still)
    pedestal, value, *extra = range(gloss + len(bodies), products.shape[-1])
    rows = np.array([[*range(gloss), body, pedestal] for body in range(gloss, pedestal)])  # (b, r), with each body
    sums = Sums(
        products=np.concatenate(products[:, rows[:, :, None], rows[:, None]]),
        data=np.concatenate(products[:, rows, value]),
        squares=float(products[0, value, value]),
        across=np.concatenate(products[:, np.array(extra, int)[:, None], rows[:, None]]),
        extra_data=products[0, extra, value],
    )
    return sums.mixed(np.hstack([shine[0].mix[0, :, :-1], matte[0].mix[0]]))


def _products(moving: Floats, still: Floats, w: Weights) -> Floats:
    """Weighted sums of products (m, g + s, g + s) of g rows with each other and with those that stay (s, n), at each
    of m shapes (m, g, n).
    """
    m, g, _ = moving.shape
    found = np.zeros((m, g + len(still), g + len(still)))
    for (here, each), (there, _) in zip(w.parts(moving), w.parts(still), strict=True):
        weighted = here * each
        found[:, :g, :g] += np.vecdot(weighted[:, :, None], here[:, None])
        found[:, :g, g:] += (weighted.reshape(m * g, -1) @ there.T).reshape(m, g, -1)
        found[:, g:, g:] += (there * each) @ there.T
    found[:, g:, :g] = found[:, :g, g:].swapaxes(-1, -2)
    return found
