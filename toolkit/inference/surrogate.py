"""The collapsed posterior of the shape as a polynomial.

Within a few sd of the mode the normal equations are very smooth functions of the shape. Solved exactly on a grid of
Chebyshev's points, they are interpolated everywhere between: the sampler then never touches the data again, whatever
the lobes, lights and number of samples. The grid gets finer until every second of its points foretells the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from toolkit.records import Floats

from .columns import Evaluate, remembering
from .problem import Optimum
from .shape_grid import MOST_NUMBERS, solved_on_grid
from .solving import inverse, solve

REACH_SD = 8.0
TOLERANCE = 0.02  # of the log density, wherever it is within DEPTH of its maximum
DEPTH = 12.0
SHORTENINGS = 6
NODES = {0: (1,), 1: (9, 17, 33, 65), 2: (9, 17), 3: (5, 9), 4: (5,), 5: (5,)}  # along each axis, from coarse to fine


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrogate:
    """Log density of the shape, and mean and Cholesky factor of the linear unknowns given it."""

    low: Floats  # (D,)
    high: Floats  # (D,)
    coefficients: Floats  # (nodes,) * D + (1 + P + P (P + 1) / 2,)
    unknowns: int
    error: float  # largest error of the log density told by half as many nodes

    def log_density(self, u: Floats) -> Floats:
        """Log density, up to a constant, at shapes (S, D); minus infinity outside the box."""
        inside = np.all((u >= self.low) & (u <= self.high), axis=-1)
        return np.where(inside, self._basis(u) @ self.coefficients[..., 0].ravel(), -np.inf)

    def on_grid(self, places: Floats) -> Floats:
        """Log density (n,) * D at every combination of `places` (n,) along each axis, from -1 to 1 of the box."""
        return _along_axes(self.coefficients[..., :1], chebvander(places, self.nodes - 1))[..., 0]

    def conditional(self, u: Floats) -> tuple[Floats, Floats]:
        """Means (S, P) of the linear unknowns and lower Cholesky factors (S, P, P) of their covariance."""
        p = self.unknowns
        table = self._basis(u) @ self.coefficients[..., 1:].reshape(-1, p + p * (p + 1) // 2)
        factor = np.zeros((len(u), p, p))
        factor[:, *np.tril_indices(p)] = table[:, p:]
        return table[:, :p], factor

    def draws(self, u: Floats, standard: Floats) -> Floats:
        """Draws (S, P) of the linear unknowns given shapes (S, D), from standard normal ones (S, P)."""
        result = np.empty(standard.shape)
        few = max(MOST_NUMBERS // self.unknowns**2, 1)
        for first in range(0, len(u), few):
            some = slice(first, first + few)
            mean, factor = self.conditional(u[some])
            result[some] = mean + np.einsum("sij,sj->si", factor, standard[some])
        return result

    @property
    def nodes(self) -> int:
        """Along each axis."""
        return len(self.coefficients) if len(self.low) else 1

    def _basis(self, u: Floats) -> Floats:
        """Products of Chebyshev polynomials at shapes (S, D): (S, nodes^D)."""
        scaled = np.clip(2 * (u - self.low) / (self.high - self.low) - 1, -1.0, 1.0)
        result = np.ones((len(u), 1))
        for d in range(len(self.low)):
            result = (result[:, :, None] * chebvander(scaled[:, d], self.nodes - 1)[:, None, :]).reshape(len(u), -1)
        return result


def surrogate_of(optimum: Optimum) -> Surrogate:
    """Interpolate around an optimum; wider than the bounds nowhere, and as fine as the density asks for."""
    parts = sum(len(view.lights) for view in optimum.problem.views)
    evaluate = remembering(optimum.problem.model, most=4 * parts)
    low, high = _box(optimum, evaluate)
    for nodes in NODES[len(low)]:
        places = -np.cos(np.pi * np.arange(nodes) / max(nodes - 1, 1))
        table = _table(optimum, low, high, places, evaluate)
        error = _error_of_half(table[..., :1], places)
        if error <= TOLERANCE:
            break
    return Surrogate(
        low=low,
        high=high,
        coefficients=_along_axes(table, np.linalg.inv(chebvander(places, nodes - 1))),
        unknowns=optimum.problem.layout.size,
        error=error,
    )


def _table(optimum: Optimum, low: Floats, high: Floats, places: Floats, evaluate: Evaluate) -> Floats:
    """All that is interpolated, exactly, at every combination of places."""
    axes = 0.5 * (np.multiply.outer(low, 1.0 - places) + np.multiply.outer(high, 1.0 + places))
    solved = solved_on_grid(optimum, axes, evaluate)
    return np.concatenate([solved.density[..., None], solved.mean, solved.factor], axis=-1)


def _error_of_half(density: Floats, places: Floats) -> float:
    """How far every second node of a log density (n, ..., 1) is from foretelling the others, where it counts."""
    half = places[::2]
    between = chebvander(places, len(half) - 1) @ np.linalg.inv(chebvander(half, len(half) - 1))
    told = _along_axes(density[(slice(None, None, 2),) * (density.ndim - 1)], between)
    return float(np.max(np.abs(told - density)[density > density.max() - DEPTH]))


def _along_axes(table: Floats, matrix: Floats) -> Floats:
    """The same matrix (n, m) applied along each but the last axis of a table (m, ..., k)."""
    for d in range(table.ndim - 1):
        table = np.moveaxis(np.tensordot(matrix, table, (1, d)), 0, d)
    return table


def _box(optimum: Optimum, evaluate: Evaluate) -> tuple[Floats, Floats]:
    """Where the density of the shape is not negligible: along each axis to where it has fallen by REACH_SD^2 / 2."""
    low, high = optimum.problem.model.bounds()
    size = optimum.problem.layout.size
    covariance = inverse(optimum.joint)[size:, size:]
    top, fall = -0.5 * float(np.linalg.slogdet(optimum.joint[:size, :size])[1]), REACH_SD**2 / 2
    box = [low.copy(), high.copy()]
    for d in range(len(low)):
        along = covariance[:, d] / covariance[d, d]
        for side, (edge, sign) in enumerate(zip((low, high), (-1.0, 1.0), strict=True)):
            reach = min(REACH_SD * covariance[d, d] ** 0.5, abs(edge[d] - optimum.u[d]))
            for _ in range(SHORTENINGS):
                there = np.clip(optimum.u + sign * reach * along, low, high)
                fallen = top - _exact(optimum, there, evaluate)[0]
                if fallen <= 2 * fall:
                    break
                reach *= max((fall / fallen) ** 0.5, 0.2)
            box[side][d] = optimum.u[d] + sign * reach
    return box[0], box[1]


def _exact(optimum: Optimum, u: Floats, evaluate: Evaluate | None = None) -> tuple[float, Floats, Floats]:
    """Log density of a shape with the linear unknowns integrated out, their mean and precision matrix."""
    problem = optimum.problem
    normal = problem.assemble(problem.columns(u, evaluate=evaluate), optimum.weights)
    mean = solve(normal.matrix, normal.rhs)
    _, log_determinant = np.linalg.slogdet(normal.matrix)
    chi2 = normal.squares - float(mean @ normal.rhs)
    return -0.5 * (chi2 - optimum.chi2) - 0.5 * float(log_determinant), mean, normal.matrix
