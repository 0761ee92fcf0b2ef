"""The collapsed posterior of the shape as a polynomial.

Within a few sd of the mode the normal equations are very smooth functions of the shape. Solved exactly on a grid of
Chebyshev's points, they are interpolated everywhere between: the sampler then never touches the data again, whatever
the lobes, lights and number of samples. The grid gets finer until half of the polynomial's degrees tell as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from toolkit.records import Floats

from .problem import Optimum
from .shape_grid import solved_on_grid
from .solving import inverse, solve

REACH_SD = 8.0
FALL = REACH_SD**2 / 2  # of the log density, over so many sds of a normal one
TOLERANCE = 0.02  # of the log density, wherever it is within DEPTH of its maximum
DEPTH = 12.0
LOOKS = 4  # places along an axis for one of the grid's, where another grid could be finer
CACHED = 2**16  # numbers in the factors that draws are made with at once
SHORTENINGS = 6
SURE = 2  # shape numbers of a grid that is cheap enough to be laid anew where it tells that its box was too wide
NODES = {0: (1,), 1: (7, 13, 33, 65), 2: (7, 17), 3: (7, 9), 4: (5,), 5: (5,)}  # along each axis, from coarse to fine


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrogate:
    """Log density of the shape, and mean and Cholesky factor of the linear unknowns given it, by their coefficients."""

    low: Floats  # (D,)
    high: Floats  # (D,)
    density: Floats  # (nodes,) * D
    mean: Floats  # (nodes,) * D + (P,)
    factor: Floats  # (nodes,) * D + (P, P), lower triangles
    error: float  # of the log density by the lower half of the coefficients, where it counts

    def log_density(self, u: Floats) -> Floats:
        """Log density, up to a constant, at shapes (S, D); minus infinity outside the box."""
        inside = np.all((u >= self.low) & (u <= self.high), axis=-1)
        first, *others = self._along(u)
        found = first @ self.density.reshape(self.nodes, -1)
        for basis in others:  # one axis after the other: never all the products of their polynomials
            found = np.einsum("sj,sjr->sr", basis, found.reshape(len(u), self.nodes, -1))
        return np.where(inside, found[:, 0], -np.inf)

    def on_grid(self, places: Floats) -> Floats:
        """Log density (n,) * D at every combination of `places` (n,) along each axis, from -1 to 1 of the box."""
        return _along_axes(self.density[..., None], chebvander(places, self.nodes - 1))[..., 0]

    def conditional(self, u: Floats) -> tuple[Floats, Floats]:
        """Means (S, P) of the linear unknowns and lower Cholesky factors (S, P, P) of their covariance."""
        basis, p = self._basis(u), self.mean.shape[-1]
        return basis @ self.mean.reshape(-1, p), (basis @ self.factor.reshape(-1, p * p)).reshape(-1, p, p)

    def draws(self, u: Floats, standard: Floats) -> Floats:
        """Draws (S, P) of the linear unknowns given shapes (S, D), from standard normal ones (S, P)."""
        result = np.empty(standard.shape)
        few = max(CACHED // standard.shape[1] ** 2, 1)
        for first in range(0, len(u), few):
            some = slice(first, first + few)
            mean, factor = self.conditional(u[some])
            result[some] = mean + (factor @ standard[some, :, None])[..., 0]
        return result

    @property
    def nodes(self) -> int:
        """Along each axis."""
        return len(self.density) if len(self.low) else 1

    def _basis(self, u: Floats) -> Floats:
        """Products of Chebyshev polynomials at shapes (S, D): (S, nodes^D)."""
        result = np.ones((len(u), 1))
        for basis in self._along(u):
            result = (result[:, :, None] * basis[:, None, :]).reshape(len(u), -1)
        return result

    def _along(self, u: Floats) -> list[Floats]:
        """Chebyshev polynomials (S, nodes) along each axis at shapes (S, D)."""
        scaled = np.clip(2 * (u - self.low) / (self.high - self.low) - 1, -1.0, 1.0)
        return [chebvander(along, self.nodes - 1) for along in scaled.T]


def surrogate_of(optimum: Optimum) -> Surrogate:
    """Interpolate around an optimum; wider than the bounds nowhere, and as fine as the density asks for."""
    (coarsest, *finer), box = NODES[len(optimum.u)], _widest(optimum)
    cut = (box == np.stack(optimum.problem.model.bounds())).any(axis=0)  # by a bound, where a density is least normal
    unsure = (box != optimum.u) & (cut | (len(optimum.u) > SURE))
    box = _shortened(optimum, box, unsure)
    found = _interpolated(optimum, box, coarsest)
    if (far := _fallen(found) > 2 * FALL).any():
        box = _shortened(optimum, box, far)
        found = _interpolated(optimum, box, coarsest)
    for nodes in finer:
        if found.error <= TOLERANCE:
            break
        found = _interpolated(optimum, box, nodes)
    return found


def _interpolated(optimum: Optimum, box: Floats, nodes: int) -> Surrogate:
    """Through what is told exactly at every combination of Chebyshev's points along the axes of a box (2, D)."""
    low, high = box
    places = _places(nodes)
    axes = 0.5 * (np.multiply.outer(low, 1.0 - places) + np.multiply.outer(high, 1.0 + places))
    solved = solved_on_grid(optimum, axes)
    to_coefficients, size = np.linalg.inv(chebvander(places, nodes - 1)), solved.mean.shape[-1]
    density, mean, triangle = (
        _along_axes(table, to_coefficients) for table in (solved.density[..., None], solved.mean, solved.factor)
    )
    factor = np.zeros((*mean.shape, size))
    factor[..., *np.tril_indices(size)] = triangle
    error = _error_of_lower(density)
    return Surrogate(low=low, high=high, density=density[..., 0], mean=mean, factor=factor, error=error)


def _places(nodes: int) -> Floats:
    """Chebyshev's points, from end to end."""
    return np.asarray(-np.cos(np.pi * np.arange(nodes) / max(nodes - 1, 1)))


def _error_of_lower(coefficients: Floats) -> float:
    """How far a polynomial (n, ..., 1) is, where it counts, from its own part of half the degree and one more.

    The whole is closer to the log density by as much as its upper degrees are worth, some hundred times where this is
    little. Looked at between the grid's points, too: of a narrow ridge askew in its box these are few.
    """
    nodes, axes = len(coefficients), coefficients.ndim - 1
    places = np.linspace(-1.0, 1.0, LOOKS * nodes + 1) if len(NODES[axes]) > 1 else _places(nodes)
    kept = min(nodes // 2 + 2, nodes)
    whole, lower = (
        _along_axes(coefficients[(slice(count),) * axes], chebvander(places, count - 1)) for count in (nodes, kept)
    )
    return float(np.max(np.abs(lower - whole)[whole > whole.max() - DEPTH]))


def _along_axes(table: Floats, matrix: Floats) -> Floats:
    """The same matrix (n, m) applied along each but the last axis of a table (m, ..., k)."""
    for d in range(table.ndim - 1):
        table = np.moveaxis(np.tensordot(matrix, table, (1, d)), 0, d)
    return table


def _widest(optimum: Optimum) -> Floats:
    """The box (2, D) within the bounds that the density of the shape would need, were it normal: REACH_SD each way."""
    sd = np.sqrt(np.diag(inverse(optimum.joint))[optimum.problem.layout.size :])
    low, high = optimum.problem.model.bounds()
    return np.stack([np.maximum(low, optimum.u - REACH_SD * sd), np.minimum(high, optimum.u + REACH_SD * sd)])


def _fallen(found: Surrogate) -> Floats:
    """How far the log density has fallen, where it did least, at the low and the high side of each axis (2, D)."""
    density = found.on_grid(_places(found.nodes))
    sides = [[density.take(end, axis).max() for axis in range(density.ndim)] for end in (0, -1)]
    return np.asarray(density.max() - np.array(sides))


def _shortened(optimum: Optimum, box: Floats, sides: NDArray[np.bool_]) -> Floats:
    """A box (2, D) with some of its sides (2, D) brought in to where the density has fallen enough, if it falls faster.

    On a side's way the other numbers follow its own as they would were the density normal.
    """
    low, high = optimum.problem.model.bounds()
    size = optimum.problem.layout.size
    covariance = inverse(optimum.joint)[size:, size:]
    top, shorter = -0.5 * float(np.linalg.slogdet(optimum.joint[:size, :size])[1]), box.copy()
    for side, axis in np.argwhere(sides):
        reach = box[side, axis] - optimum.u[axis]
        for _ in range(SHORTENINGS):
            along = reach * covariance[:, axis] / covariance[axis, axis]
            fallen = top - _exact(optimum, np.clip(optimum.u + along, low, high))[0]
            if fallen <= 2 * FALL:
                break
            reach *= max((FALL / fallen) ** 0.5, 0.2)
        shorter[side, axis] = optimum.u[axis] + reach
    return shorter


def _exact(optimum: Optimum, u: Floats) -> tuple[float, Floats, Floats]:
    """Log density of a shape with the linear unknowns integrated out, their mean and precision matrix."""
    problem = optimum.problem
    normal = problem.assemble(problem.columns(u), optimum.weights)
    mean = solve(normal.matrix, normal.rhs)
    _, log_determinant = np.linalg.slogdet(normal.matrix)
    chi2 = normal.squares - float(mean @ normal.rhs)
    return -0.5 * (chi2 - optimum.chi2) - 0.5 * float(log_determinant), mean, normal.matrix
