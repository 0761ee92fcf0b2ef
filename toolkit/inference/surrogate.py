"""The collapsed posterior of the shape as a polynomial.

Within a few sd of the mode the normal equations are very smooth functions of the shape. Solved exactly at a few
Chebyshev nodes, they are interpolated everywhere between: the sampler then never touches the data again, whatever the
lobes, lights and number of samples. The number of nodes grows until the interpolation is exact to `TOLERANCE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from toolkit.records import Floats

from .model import Evaluate, Model, remembering
from .normal import inverse, solve
from .problem import Optimum

REACH_SD = 8.0
TOLERANCE = 0.02  # of the log density, wherever it is within DEPTH of its maximum
DEPTH = 12.0
SHORTENINGS = 6
NODES = {0: (1,), 1: (7, 13, 25, 49), 2: (5, 7, 11, 17), 3: (5, 7, 9), 4: (5,)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrogate:
    """Log density of the shape, and mean and Cholesky factor of the linear unknowns given it."""

    low: Floats  # (D,)
    high: Floats  # (D,)
    nodes: int
    coefficients: Floats  # (nodes^D, 1 + P + P (P + 1) / 2)
    unknowns: int
    error: float  # largest error of the log density seen at places between the nodes

    def log_density(self, u: Floats) -> Floats:
        """Log density, up to a constant, at shapes (S, D); minus infinity outside the box."""
        inside = np.all((u >= self.low) & (u <= self.high), axis=-1)
        return np.where(inside, self._basis(u) @ self.coefficients[:, 0], -np.inf)

    def conditional(self, u: Floats) -> tuple[Floats, Floats]:
        """Means (S, P) of the linear unknowns and lower Cholesky factors (S, P, P) of their covariance."""
        p = self.unknowns
        table = self._basis(u) @ self.coefficients[:, 1:]
        factor = np.zeros((len(u), p, p))
        factor[:, *np.tril_indices(p)] = table[:, p:]
        return table[:, :p], factor

    def _basis(self, u: Floats) -> Floats:
        return _basis(u, self.low, self.high, self.nodes)


def _basis(u: Floats, low: Floats, high: Floats, nodes: int) -> Floats:
    """Products of Chebyshev polynomials at shapes (S, D): (S, nodes^D)."""
    result = np.ones((len(u), 1))
    for d in range(len(low)):
        scaled = np.clip(2 * (u[:, d] - low[d]) / (high[d] - low[d]) - 1, -1.0, 1.0)
        result = (result[:, :, None] * chebvander(scaled, nodes - 1)[:, None, :]).reshape(len(u), -1)
    return result


def surrogate_of(optimum: Optimum) -> Surrogate:
    """Interpolate around an optimum; wider than the bounds nowhere, and as fine as the density asks for."""
    low, high = _box(optimum)
    size = optimum.problem.layout.size
    tests = low + (high - low) * np.random.default_rng(0).uniform(0.25, 0.75, (4 if len(low) else 0, len(low)))
    truth = np.array([_exact(optimum, u)[0] for u in tests])
    near = truth > truth.max(initial=-np.inf) - DEPTH
    for nodes in NODES[len(low)]:
        found = _interpolate(optimum, low, high, nodes)
        error = float(np.max(np.abs(found.log_density(tests) - truth)[near], initial=0.0))
        if error <= TOLERANCE:
            break
    return Surrogate(low=low, high=high, nodes=found.nodes, coefficients=found.coefficients, unknowns=size, error=error)


def _box(optimum: Optimum) -> tuple[Floats, Floats]:
    """Where the density of the shape is not negligible: along each axis to where it has fallen by REACH_SD^2 / 2."""
    low, high = optimum.problem.model.bounds()
    covariance = inverse(optimum.joint)[optimum.problem.layout.size :, optimum.problem.layout.size :]
    top, fall = _exact(optimum, optimum.u)[0], REACH_SD**2 / 2
    box = [low.copy(), high.copy()]
    for d in range(len(low)):
        along = covariance[:, d] / covariance[d, d]
        for side, (edge, sign) in enumerate(zip((low, high), (-1.0, 1.0), strict=True)):
            reach = min(REACH_SD * covariance[d, d] ** 0.5, abs(edge[d] - optimum.u[d]))
            for _ in range(SHORTENINGS):
                there = np.clip(optimum.u + sign * reach * along, low, high)
                fallen = top - _exact(optimum, there)[0]
                if fallen <= 2 * fall:
                    break
                reach *= max((fall / fallen) ** 0.5, 0.2)
            box[side][d] = optimum.u[d] + sign * reach
    return box[0], box[1]


def _interpolate(optimum: Optimum, low: Floats, high: Floats, nodes: int) -> Surrogate:
    places = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    u = low + (high - low) * (_grid(places, optimum.problem.model) + 1) / 2
    lights = sum(len(view.lights) for view in optimum.problem.views)
    lobes = remembering(optimum.problem.model, most=lights * (nodes + 1))
    table = np.array([_exact_row(optimum, point, lobes) for point in u])
    return Surrogate(
        low=low,
        high=high,
        nodes=nodes,
        coefficients=np.linalg.solve(_basis(u, low, high, nodes), table),
        unknowns=optimum.problem.layout.size,
        error=0.0,
    )


def _grid(places: Floats, model: Model) -> Floats:
    """Every combination of places along the shape numbers (S, D); the numbers of the lobe that has more turn slowest.

    So a lobe with one number, or none, comes back to values that it had, and the other stays at its values meanwhile.
    """
    count, sharp = len(model.parameters), len(model.specular.parameters)
    grid = np.array(list(product(places, repeat=count))).reshape(-1, count)
    return grid if 2 * sharp >= count else np.roll(grid, sharp, axis=1)


def _exact(optimum: Optimum, u: Floats, evaluate: Evaluate | None = None) -> tuple[float, Floats, Floats]:
    """Log density of a shape with the linear unknowns integrated out, their mean and precision matrix."""
    problem = optimum.problem
    normal = problem.assemble(problem.columns(u, evaluate=evaluate), optimum.weights)
    mean = solve(normal.matrix, normal.rhs)
    _, log_determinant = np.linalg.slogdet(normal.matrix)
    chi2 = normal.squares - float(mean @ normal.rhs)
    return -0.5 * (chi2 - optimum.chi2) - 0.5 * float(log_determinant), mean, normal.matrix


def _exact_row(optimum: Optimum, u: Floats, evaluate: Evaluate) -> Floats:
    density, mean, precision = _exact(optimum, u, evaluate)
    factor = np.linalg.cholesky(inverse(precision))
    return np.concatenate([[density], mean, factor[np.tril_indices(len(mean))]])
