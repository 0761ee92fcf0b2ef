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
from .model import Evaluate
from .normal import Sums, equations
from .problem import Optimum
from .weights import Weights

BODY = 1  # the row of a table of columns that is the body lobe's; the others are the highlight's, or no lobe's
RIDGE = 1e-13  # of a diagonal of ones


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """At shapes (...): log density with the linear unknowns integrated out, their means (..., P), and lower Cholesky
    factors (..., P, P) of their covariance.
    """

    density: Floats
    mean: Floats
    factor: Floats


def solved_on_grid(optimum: Optimum, axes: Floats, evaluate: Evaluate) -> Solved:
    """The answers at every combination of the values `axes` (D, n) of the shape numbers, (n,) * D of them.

    `evaluate` remembers lobes. Raises LinAlgError where the equations have no one answer.
    """
    matrix, rhs, squares = _equations(optimum, axes, evaluate)
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-300))
    across = scale[..., :, None] * scale[..., None, :]
    scaled = matrix * across + RIDGE * np.eye(matrix.shape[-1])
    mean = np.linalg.solve(scaled, (rhs * scale)[..., None])[..., 0] * scale
    chi2 = squares - np.sum(mean * rhs, axis=-1)
    log_determinant = np.linalg.slogdet(scaled)[1] - 2.0 * np.sum(np.log(scale), axis=-1)
    return Solved(
        density=-0.5 * (chi2 - optimum.chi2) - 0.5 * log_determinant,
        mean=mean,
        factor=np.linalg.cholesky(np.linalg.inv(scaled) * across),
    )


def _equations(optimum: Optimum, axes: Floats, evaluate: Evaluate) -> tuple[Floats, Floats, Floats]:
    """Matrix (..., P, P), right-hand side (..., P) and squares (...) on the grid."""
    problem, weighing = optimum.problem, optimum.weights
    layout, sharp = problem.layout, len(problem.model.specular.parameters)
    glosses, bodies = (np.array(list(product(*part))) for part in (axes[:sharp], axes[sharp:]))
    last = len(glosses) - 1, len(bodies) - 1
    shapes = [
        np.concatenate([glosses[min(i, last[0])], bodies[min(i, last[1])]]) for i in range(max(last) + 1)
    ]  # every shape of either lobe at least once
    cols = [problem.columns(u, evaluate=evaluate) for u in shapes]
    sums = []
    for c, data in enumerate(problem.channels):
        tables = [one[c].table for one in cols]
        bodies_of = np.stack([table[BODY] for table in tables[: len(bodies)]])
        sums.append(_sums(tables[: len(glosses)], bodies_of, data, weighing.weights[c], weighing.weighted[c]))
    matrix, rhs, squares = equations(tuple(sums), layout, problem.prior)
    for one, index, extra, gram in zip(sums, layout.index, layout.extras, weighing.gram, strict=True):
        matrix[..., extra, index] += one.across[..., 1:]
        matrix[..., index, extra] += np.swapaxes(one.across[..., 1:], -1, -2)
        matrix[..., extra, extra] += gram
        rhs[..., extra] += one.extra_data - one.across[..., 0]
    grid = axes.shape[1:] * len(axes)
    return matrix.reshape(*grid, *matrix.shape[2:]), rhs.reshape(*grid, -1), squares.reshape(grid)


def _sums(tables: Sequence[Floats], body: Floats, data: ChannelCells, w: Weights, extra: Floats) -> Sums:
    """One channel's sums at all (m, b) shapes.

    Of the `tables` (k + 1, n), m of them, all but the body's column is taken; `body` (b, n) are the body's columns,
    `extra` (q, n) are the extra columns times the weights.
    """
    m, b, rows = len(tables), len(body), len(tables[0])
    of_body, value = w.apart(body), w.apart(data.value)
    value_w, others = value * w.each, np.delete(np.arange(rows), BODY)
    products, told, across = np.empty((m, b, rows, rows)), np.empty((m, b, rows)), np.empty((m, b, len(extra), rows))
    products[..., BODY, BODY] = np.einsum("bn,n,bn->b", of_body, w.each, of_body)
    told[..., BODY], across[..., BODY] = of_body @ value_w, body @ extra.T
    for i, table in enumerate(tables):
        gloss = table[others]
        apart = w.apart(gloss)
        weighted = apart * w.each
        products[i][..., others[:, None], others] = weighted @ apart.T
        products[i][..., BODY, others] = of_body @ weighted.T
        told[i][..., others] = apart @ value_w
        across[i][..., others] = extra @ gloss.T
    products[..., others, BODY] = products[..., BODY, others]
    return Sums(
        products=products,
        data=told,
        squares=float(value_w @ value),
        across=across,
        extra_data=extra @ data.value,
    )
