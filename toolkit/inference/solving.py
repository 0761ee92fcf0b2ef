"""Symmetric positive systems, as normal equations are: solved, inverted, kept within bounds, some unknowns left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

from toolkit.records import Floats

from .normal import Prior

RIDGE = 1e-13  # of a diagonal of ones


def solve(matrix: Floats, rhs: Floats) -> Floats:
    """Solve a symmetric positive system, scaled so that units do not matter; never raises on a singular one."""
    if not len(matrix):
        return np.zeros(rhs.shape)
    scale = 1.0 / np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
    scaled = matrix * scale[:, None] * scale
    one = rhs.ndim == 1
    wanted = (rhs * scale)[:, None] if one else rhs * scale[:, None]
    raised = scaled.copy()
    raised.flat[:: len(scale) + 1] += RIDGE
    _, result, failed = dposv(raised, wanted, lower=1)
    if failed:
        result = np.linalg.lstsq(scaled, wanted, rcond=1e-12)[0]
    return np.asarray(result[:, 0] * scale if one else result * scale[:, None])


def inverse(matrix: Floats) -> Floats:
    """Covariance from a precision matrix."""
    covariance = solve(matrix, np.eye(len(matrix)))
    return 0.5 * (covariance + covariance.T)


def scaled_each(matrix: Floats) -> tuple[Floats, Floats]:
    """Symmetric positive matrices (S, P, P) with a diagonal of ones and a little more, so that units do not matter;
    and what their rows and columns were multiplied with (S, P).
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-300))
    return matrix * scale[:, :, None] * scale[:, None, :] + RIDGE * np.eye(matrix.shape[-1]), scale


def inverse_each(matrix: Floats) -> Floats:
    """Covariances (S, P, P) from precision matrices."""
    scaled, scale = scaled_each(matrix)
    return np.asarray(np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :])


def marginal(matrix: Floats, own: NDArray[np.intp]) -> Floats:
    """Precision matrix of some unknowns (p,) from that of all, the others integrated out: Schur's complement."""
    rest = np.delete(np.arange(len(matrix)), own)
    across = matrix[rest[:, None], own]
    return np.asarray(matrix[own[:, None], own] - across.T @ solve(matrix[rest[:, None], rest], across))


def bounded(matrix: Floats, rhs: Floats, prior: Prior) -> tuple[Floats, NDArray[np.bool_]]:
    """Minimise x'Mx/2 - r'x within the prior's range; also which coefficients rest on a bound.

    Active set: what violates its bound is fixed there, what would move inside is freed again.
    """
    return _within(matrix, rhs, prior, solve(matrix, rhs))


def _within(matrix: Floats, rhs: Floats, prior: Prior, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The same from where `x` would be least without the prior's range."""
    x, fixed = x.copy(), np.zeros(len(x), bool)
    if ((x >= prior.low) & (x <= prior.high)).all():
        return x, fixed
    for _ in range(3 * len(x)):
        outside = ~fixed & ((x < prior.low) | (x > prior.high))
        gradient = matrix @ x - rhs
        freed = fixed & (((x <= prior.low) & (gradient < 0)) | ((x >= prior.high) & (gradient > 0)))
        if not outside.any() and not freed.any():
            break
        fixed = (fixed | outside) & ~freed
        x = np.minimum(np.maximum(x, prior.low), prior.high)
        free, rest = np.flatnonzero(~fixed), rhs - matrix @ np.where(fixed, x, 0.0)
        x[free] = solve(matrix[free[:, None], free], rest[free])
    return np.minimum(np.maximum(x, prior.low), prior.high), fixed


def bounded_each(matrix: Floats, rhs: Floats, prior: Prior) -> Floats:
    """The same of several systems (S, P, P) and (S, P) at once: (S, P)."""
    scaled, scale = scaled_each(matrix)
    found = np.linalg.solve(scaled, (rhs * scale)[..., None])[..., 0] * scale
    for i in np.flatnonzero(((found < prior.low) | (found > prior.high)).any(axis=-1)):
        found[i], _ = _within(matrix[i], rhs[i], prior, found[i])
    return np.asarray(found)
