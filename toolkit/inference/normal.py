"""The normal equations of everything linear: colours, pedestals and calibration shifts, for all channels at once.

The channels of several photographs of one material stand side by side: three of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from toolkit.records import Floats, readonly

from .cells import ChannelCells
from .columns import Columns
from .weights import Weights

SHARED = frozenset({"specular_scale"})  # one number for all channels, whatever the specular colour


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """Which global coefficient each channel's columns belong to; extra columns, of each photograph's own, follow."""

    names: tuple[tuple[str, int | None], ...]  # (name, channel), channel None where shared
    index: tuple[NDArray[np.intp], ...]  # per channel, global index of each of its columns
    extras: tuple[slice, ...]  # per channel, where its further columns are: those of its photograph

    @property
    def size(self) -> int:
        """Number of linear unknowns."""
        return int(self.extras[-1].stop)

    def with_extras(self, counts: Sequence[int]) -> Layout:
        """With as many further columns of each photograph, shared by its three channels."""
        ends = len(self.names) + np.cumsum([0, *counts])
        each = [slice(int(start), int(end)) for start, end in pairwise(ends)]
        return replace(self, extras=tuple(own for own in each for _ in range(3)))

    def of(self, name: str, values: Floats) -> Floats:
        """The coefficients called `name`, one a channel (..., 3); shared ones are repeated."""
        where = [
            next((i for i, (n, c) in enumerate(self.names) if n == name and c in (channel, None)), -1)
            for channel in range(3)
        ]
        return np.asarray(values[..., where])


def lay_out(names: tuple[str, ...], *, neutral: bool, photographs: int = 1) -> Layout:
    """One coefficient a channel for every column, but for shared ones and, where `neutral`, the specular ones.

    Photographs share all of them but the pedestal: that of the second is `pedestal_2`.
    """
    order: dict[tuple[str, int | None], int] = {}
    index: list[NDArray[np.intp]] = []
    for photograph in range(photographs):
        own = [numbered(name, photograph) if name == "pedestal" else name for name in names]
        for channel in range(3):
            keys = [(name, None if _is_shared(name, neutral=neutral) else channel) for name in own]
            index.append(np.array([order.setdefault(key, len(order)) for key in keys], np.intp))
    none = slice(len(order), len(order))
    return Layout(names=tuple(order), index=tuple(index), extras=(none,) * len(index))


def numbered(name: str, photograph: int) -> str:
    """The name of what each photograph has of its own: plain for the first."""
    return name if photograph == 0 else f"{name}_{photograph + 1}"


def _is_shared(name: str, *, neutral: bool) -> bool:
    return name in SHARED or (neutral and name.startswith("specular"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prior:
    """Gaussian prior on the linear unknowns, and the range that each may lie in."""

    precision: Floats  # (P, P)
    centre: Floats  # (P,)
    low: Floats  # (P,)
    high: Floats  # (P,)

    def __post_init__(self) -> None:
        readonly(self)

    def first(self, count: int) -> Prior:
        """That of the first unknowns, as if nothing were known of the others."""
        return Prior(
            precision=self.precision[:count, :count].copy(),
            centre=self.centre[:count].copy(),
            low=self.low[:count].copy(),
            high=self.high[:count].copy(),
        )

    def joined(self, precision: Floats, centre: Floats) -> Prior:
        """With that of further unknowns, independent of these and of any size."""
        anywhere = np.full(len(centre), np.inf)
        return Prior(
            precision=block_diag(self.precision, precision),
            centre=np.concatenate([self.centre, centre]),
            low=np.concatenate([self.low, -anywhere]),
            high=np.concatenate([self.high, anywhere]),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normal:
    """matrix @ x = rhs, of P linear unknowns, followed by D shape steps where derivatives were asked for."""

    matrix: Floats
    rhs: Floats
    squares: float  # weighted sum of squares of the data less the known offset


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weighing:
    """Weights of the cells per channel, with all that follows from them and the extra columns alone."""

    weights: tuple[Weights, ...]
    weighted: tuple[Floats, ...]  # (q, n) each, the extra columns times the weights
    gram: tuple[Floats, ...]  # (q, q) each

    @property
    def counted(self) -> int:
        """How many data count, of all channels."""
        return sum(w.counted for w in self.weights)

    def scaled(self, factor: float) -> Weighing:
        """All weights times a factor."""
        if factor == 1.0:
            return self
        return Weighing(
            weights=tuple(w.scaled(factor) for w in self.weights),
            weighted=tuple(factor * each for each in self.weighted),
            gram=tuple(factor * each for each in self.gram),
        )


def weigh(weights: tuple[Weights, ...], extras: tuple[Floats, ...]) -> Weighing:
    """Weights of a problem with these extra columns, (n, q) per channel."""
    weighted = tuple(w.times(e.T) if e.size else e.T for e, w in zip(extras, weights, strict=True))
    return Weighing(
        weights=weights, weighted=weighted, gram=tuple(a @ e for a, e in zip(weighted, extras, strict=True))
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """One channel's weighted sums of products: all that normal equations at one shape need of the cells.

    Of some rows (m of them), as those of the columns, the data and the extra columns; leading axes as the rows have.
    """

    products: Floats  # (..., m, m)
    data: Floats  # (..., m), with the data
    squares: float  # of the data
    across: Floats  # (q, m), with the extra columns
    extra_data: Floats  # (q,), of the extra columns with the data

    def part(self, some: slice) -> Sums:
        """Of some of the shapes along the first axis."""
        return replace(self, products=self.products[some], data=self.data[some], across=self.across[some])

    def mixed(self, mix: Floats) -> Sums:
        """Those of rows that are sums (l, m) of these."""
        products = mix @ self.products @ mix.T
        return replace(self, products=products, data=self.data @ mix.T, across=self.across @ mix.T)


def sums_of(columns: tuple[Columns, ...], channels: tuple[ChannelCells, ...], weighing: Weighing) -> tuple[Sums, ...]:
    """Of the columns' rows: one pass over the cells of each channel."""
    found = []
    for cols, data, w, extra in zip(columns, channels, weighing.weights, weighing.weighted, strict=True):
        rows = cols.rows
        products, told, squares = np.zeros((*rows.shape[:-1], rows.shape[-2])), np.zeros(rows.shape[:-1]), 0.0
        for (part, each), (value, _) in zip(w.parts(rows), w.parts(data.value), strict=True):
            weighted = part * each
            products += weighted @ part.swapaxes(-1, -2)
            told += weighted @ value
            squares += float((value * each) @ value)
        found.append(
            Sums(
                products=products,
                data=told,
                squares=squares,
                across=extra @ rows.swapaxes(-1, -2),
                extra_data=extra @ data.value,
            )
        )
    return tuple(found)


def equations(
    sums: tuple[Sums, ...], layout: Layout, prior: Prior, gram: tuple[Floats, ...]
) -> tuple[Floats, Floats, Floats]:
    """Matrix (..., P, P), right-hand side (..., P) and squares (...) of the linear unknowns at several shapes.

    The sums are of the part with a known coefficient, then of the columns; `gram` as in a `Weighing`.
    """
    batch = sums[0].data.shape[:-1]
    matrix, rhs = np.empty((*batch, *prior.precision.shape)), np.empty((*batch, len(prior.centre)))
    matrix[...], rhs[...] = prior.precision, prior.precision @ prior.centre
    squares = np.full(batch, float(prior.centre @ prior.precision @ prior.centre))
    for one, index, extra, of_extra in zip(sums, layout.index, layout.extras, gram, strict=True):
        mine = slice(1, 1 + len(index))
        matrix[..., index[:, None], index] += one.products[..., mine, mine]
        rhs[..., index] += one.data[..., mine] - one.products[..., mine, 0]
        squares += one.squares - 2.0 * one.data[..., 0] + one.products[..., 0, 0]
        if len(of_extra):
            matrix[..., extra, index] += one.across[..., mine]
            matrix[..., index, extra] += np.swapaxes(one.across[..., mine], -1, -2)
            matrix[..., extra, extra] += of_extra
            rhs[..., extra] += one.extra_data - one.across[..., 0]
    return matrix, rhs, squares


def combine(
    columns: tuple[Columns, ...],
    sums: tuple[Sums, ...],
    weighing: Weighing,
    layout: Layout,
    prior: Prior,
    at: Floats | None = None,
) -> Normal:
    """Normal equations at one shape, from sums of its columns' rows; with coefficients `at` (P,), of the steps from
    them and from the shape.
    """
    size = layout.size
    here = np.zeros(size) if at is None else at
    shapes = np.arange(size, size + (0 if at is None else len(columns[0].mix) - 1))
    matrix, rhs = np.zeros((size + len(shapes),) * 2), np.zeros(size + len(shapes))
    matrix[:size, :size] = prior.precision
    rhs[:size] = prior.precision @ (prior.centre - here)
    squares = float((prior.centre - here) @ rhs[:size])
    for cols, one, gram, index, extra in zip(columns, sums, weighing.gram, layout.index, layout.extras, strict=True):
        mix, to = cols.mix[0], index
        if at is not None:
            along = cols.along(here[index])
            mix, to = np.concatenate([along[:1], cols.slopes(along)]), np.concatenate([index, shapes])
        products, told = mix @ one.products @ mix.T, mix @ one.data
        rest = told[1:] - products[1:, 0]
        squares += float(one.squares - 2.0 * told[0] + products[0, 0])
        if len(gram):
            across = one.across @ mix.T
            slopes, left = across[:, 1:], one.extra_data - across[:, 0]
            matrix[extra, to] += slopes
            matrix[to, extra] += slopes.T
            matrix[extra, extra] += gram
            rhs[extra] += left - gram @ here[extra]
            squares += float(here[extra] @ (gram @ here[extra] - 2.0 * left))
            rest -= slopes.T @ here[extra]
        matrix[to[:, None], to] += products[1:, 1:]
        rhs[to] += rest
    return Normal(matrix=matrix, rhs=rhs, squares=squares)
