"""The normal equations of everything linear: colours, pedestal and calibration shifts, for all channels at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

from .cells import Cells
from .model import Columns

SHARED = frozenset({"specular_scale"})  # one number for all channels, whatever the specular colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """Which global coefficient each channel's columns belong to; extra columns, shared by all channels, follow."""

    names: tuple[tuple[str, int | None], ...]  # (name, channel), channel None where shared
    index: tuple[NDArray[np.intp], ...]  # per channel, global index of each of its columns
    extras: int  # how many shared columns follow the named ones

    @property
    def size(self) -> int:
        """Number of linear unknowns."""
        return len(self.names) + self.extras

    def of(self, name: str, values: Floats) -> Floats:
        """The coefficients called `name`, one a channel (..., 3); shared ones are repeated."""
        where = [
            next((i for i, (n, c) in enumerate(self.names) if n == name and c in (channel, None)), -1)
            for channel in range(3)
        ]
        return np.asarray(values[..., where])


def lay_out(names: tuple[str, ...], *, neutral: bool, extras: int) -> Layout:
    """One coefficient a channel for every column, but for shared ones and, where `neutral`, the specular ones."""
    order: list[tuple[str, int | None]] = []
    index: list[NDArray[np.intp]] = []
    for channel in range(3):
        mine = []
        for name in names:
            shared = name in SHARED or (neutral and name.startswith("specular"))
            key = (name, None if shared else channel)
            if key not in order:
                order.append(key)
            mine.append(order.index(key))
        index.append(np.array(mine, np.intp))
    return Layout(names=tuple(order), index=tuple(index), extras=extras)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prior:
    """Gaussian prior on the linear unknowns, and the range that each may lie in."""

    precision: Floats  # (P, P)
    centre: Floats  # (P,)
    low: Floats  # (P,)
    high: Floats  # (P,)

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normal:
    """matrix @ x = rhs, of P linear unknowns, followed by D shape steps where derivatives were asked for."""

    matrix: Floats
    rhs: Floats
    squares: float  # weighted sum of squares of the data less the known offset


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weighing:
    """Weights of the cells per channel, with all that follows from them and the extra columns alone."""

    weights: tuple[Floats, ...]  # (n,) each, one over the variance of a cell's mean
    weighted: tuple[Floats, ...]  # (q, n) each, the extra columns times the weights
    gram: tuple[Floats, ...]  # (q, q) each


def weigh(weights: tuple[Floats, ...], extras: tuple[Floats, ...]) -> Weighing:
    """Weights of a problem with these extra columns, (n, q) per channel."""
    weighted = tuple(np.ascontiguousarray(e.T * w) for e, w in zip(extras, weights, strict=True))
    return Weighing(
        weights=weights, weighted=weighted, gram=tuple(a @ e for a, e in zip(weighted, extras, strict=True))
    )


def assemble(
    columns: tuple[Columns, ...],
    cells: Cells,
    weighing: Weighing,
    layout: Layout,
    prior: Prior,
    extras: tuple[Floats, ...],
    at: Floats | None = None,
) -> Normal:
    """Normal equations at one shape; with coefficients `at` (P,), of the steps from them and from the shape."""
    shapes = len(columns[0].d_offset) if at is not None else 0
    named, size = len(layout.names), layout.size + shapes
    matrix, rhs, squares = np.zeros((size, size)), np.zeros(size), 0.0
    towards = prior.centre if at is None else prior.centre - at
    matrix[: layout.size, : layout.size] += prior.precision
    rhs[: layout.size] += prior.precision @ towards
    squares += float(towards @ prior.precision @ towards)
    extra = np.arange(named, layout.size)
    for c, (cols, data, w) in enumerate(zip(columns, cells.channels, weighing.weights, strict=True)):
        index = np.concatenate([layout.index[c], np.arange(layout.size, size)])
        y, mine = data.value - cols.offset, cols.matrix
        if at is not None:
            here = at[layout.index[c]]
            y = y - cols.matrix @ here - extras[c] @ at[named : layout.size]
            slopes = [m @ here + o for m, o in zip(cols.d_matrix, cols.d_offset, strict=True)]
            mine = np.column_stack([cols.matrix, *slopes])
        weighted = mine.T * w
        matrix[np.ix_(index, index)] += weighted @ mine
        rhs[index] += weighted @ y
        squares += float(w @ (y * y))
        if layout.extras:
            across = weighing.weighted[c] @ mine
            matrix[np.ix_(extra, index)] += across
            matrix[np.ix_(index, extra)] += across.T
            matrix[np.ix_(extra, extra)] += weighing.gram[c]
            rhs[extra] += weighing.weighted[c] @ y
    return Normal(matrix=matrix, rhs=rhs, squares=squares)


def solve(matrix: Floats, rhs: Floats) -> Floats:
    """Solve a symmetric positive system, scaled so that units do not matter; never raises on a singular one."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * scale[:, None] * scale
    try:
        factor = scipy.linalg.cho_factor(scaled + 1e-13 * np.eye(len(scale)))
        result: Floats = scipy.linalg.cho_solve(factor, (rhs.T * scale).T)
    except scipy.linalg.LinAlgError:
        result = np.linalg.lstsq(scaled, (rhs.T * scale).T, rcond=1e-12)[0]
    return np.asarray((result.T * scale).T)


def inverse(matrix: Floats) -> Floats:
    """Covariance from a precision matrix."""
    covariance = solve(matrix, np.eye(len(matrix)))
    return 0.5 * (covariance + covariance.T)


def bounded(matrix: Floats, rhs: Floats, prior: Prior) -> tuple[Floats, NDArray[np.bool_]]:
    """Minimise x'Mx/2 - r'x within the prior's range; also which coefficients rest on a bound.

    Active set: what violates its bound is fixed there, what would move inside is freed again.
    """
    x: Floats = solve(matrix, rhs)
    fixed = np.zeros(len(x), bool)
    for _ in range(3 * len(x)):
        outside = ~fixed & ((x < prior.low) | (x > prior.high))
        gradient = matrix @ x - rhs
        freed = fixed & (((x <= prior.low) & (gradient < 0)) | ((x >= prior.high) & (gradient > 0)))
        if not outside.any() and not freed.any():
            break
        fixed = (fixed | outside) & ~freed
        x = np.clip(x, prior.low, prior.high)
        free = ~fixed
        x[free] = solve(matrix[np.ix_(free, free)], rhs[free] - matrix[np.ix_(free, fixed)] @ x[fixed])
    return np.clip(x, prior.low, prior.high), fixed
