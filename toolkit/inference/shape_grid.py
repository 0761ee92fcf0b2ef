"""Everything linear solved for on a grid of shapes, with each lobe evaluated at its own shapes only.

A model's columns are the body lobe's, which depends on its own shape numbers alone, and the highlight's, which depend
on theirs. On a grid of m x n shapes of the two there are m + n tables of columns, and the normal equations of all m n
shapes are sums of products of two of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from toolkit.records import Floats

from .cells import ChannelCells
from .columns import Evaluate, columns
from .normal import Sums, equations
from .problem import Optimum
from .solving import scaled_each
from .weights import Weights

BODY = 1  # the column that is the body lobe's; the others are the highlight's, or no lobe's
MOST_NUMBERS = 2**23  # in the matrices that are worked on at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """At shapes (...): log density with the linear unknowns integrated out, their means (..., P), and the lower
    triangles (..., P (P + 1) / 2) of the Cholesky factors of their covariance, row by row.
    """

    density: Floats
    mean: Floats
    factor: Floats


def solved_on_grid(optimum: Optimum, axes: Floats, evaluate: Evaluate) -> Solved:
    """The answers at every combination of the values `axes` (D, n) of the shape numbers, (n,) * D of them.

    `evaluate` remembers lobes. Raises LinAlgError where the equations have no one answer.
    """
    problem = optimum.problem
    sums = [one for v in range(len(problem.views)) for one in _sums_of(optimum, v, axes, evaluate)]
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


def _sums_of(optimum: Optimum, photograph: int, axes: Floats, evaluate: Evaluate) -> list[Sums]:
    """Of one photograph's three channels, at all shapes of the grid one after the other (g, ...)."""
    problem, view = optimum.problem, optimum.problem.views[photograph]
    sharp = len(problem.model.specular.parameters)
    glosses, bodies = (np.array(list(product(*part))) for part in (axes[:sharp], axes[sharp:]))
    last = len(glosses) - 1, len(bodies) - 1
    shapes = [
        np.concatenate([glosses[min(i, last[0])], bodies[min(i, last[1])]]) for i in range(max(last) + 1)
    ]  # every shape of either lobe at least once
    cols = [columns(problem.model, problem.fresnel, view.lights, view.cells, u, evaluate=evaluate) for u in shapes]
    sums = []
    for c, data in enumerate(view.cells.channels):
        rows, mix, of_all = [one[c].rows for one in cols], cols[0][c].mix[0], 3 * photograph + c
        body = int(np.flatnonzero(mix[BODY])[0])
        bodies_of = np.stack([each[body] for each in rows[: len(bodies)]])
        weights, weighted = optimum.weights.weights[of_all], optimum.weights.weighted[of_all]
        sums.append(_sums(rows[: len(glosses)], bodies_of, body, data, weights, weighted).mixed(mix))
    return sums


def _sums(tables: Sequence[Floats], bodies: Floats, body: int, data: ChannelCells, w: Weights, extra: Floats) -> Sums:
    """One channel's sums at all m b shapes.

    Of the `tables` (r, n), m of them, all but the row `body` is taken; `bodies` (b, n) are what that is at the body's
    shapes, `extra` (q, n) are the extra columns times the weights.
    """
    m, b, rows = len(tables), len(bodies), len(tables[0])
    of_body, value = w.apart(bodies), w.apart(data.value)
    value_w, others = value * w.each, np.delete(np.arange(rows), body)
    products, told, across = np.empty((m, b, rows, rows)), np.empty((m, b, rows)), np.empty((m, b, len(extra), rows))
    products[..., body, body] = np.einsum("bn,n,bn->b", of_body, w.each, of_body)
    told[..., body], across[..., body] = of_body @ value_w, bodies @ extra.T
    for i, table in enumerate(tables):
        gloss = table[others]
        apart = w.apart(gloss)
        weighted = apart * w.each
        products[i][..., others[:, None], others] = weighted @ apart.T
        products[i][..., body, others] = of_body @ weighted.T
        told[i][..., others] = apart @ value_w
        across[i][..., others] = extra @ gloss.T
    products[..., others, body] = products[..., body, others]
    return Sums(
        products=products.reshape(m * b, rows, rows),
        data=told.reshape(m * b, rows),
        squares=float(value_w @ value),
        across=across.reshape(m * b, -1, rows),
        extra_data=extra @ data.value,
    )
