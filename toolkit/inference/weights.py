"""The weights of a channel's data: the inverse of their covariance, cell by cell.

The noise grows with the signal, so on the brighter side of a cell it is larger, and an error of the mean comes with one
of the slopes. A slope less what the mean tells of its error is independent of it: the inverse covariance of a cell is
L^T diag(each) L with L = (1, 0, 0; -lean_x, 1, 0; -lean_y, 0, 1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, Noise, readonly

from .cells import ChannelCells


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weights:
    """Of the m data of one channel: one over each one's own variance, 0 where it counts for nothing."""

    each: Floats  # (m,)
    lean: Floats  # (2, n), error of the slopes in x and in y for each unit of the mean's; (0, n) without slopes
    clipped: NDArray[np.intp]  # (k,), which of the data are only bounds from below
    short: Floats  # (k,), what each of these weighs where the prediction falls short of it; elsewhere nothing

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def counted(self) -> int:
        """How many data count."""
        return int(np.count_nonzero(self.each > 0.0))

    @property
    def of_cells(self) -> Floats:
        """Of the cells' means (n,), without what the slopes add."""
        return self.each[: self.lean.shape[1]]

    @property
    def of_means(self) -> Floats:
        """The weights matrix's diagonal at the means (n,), between which it has nothing else."""
        each = self.each.reshape(1 + len(self.lean), -1)
        return np.asarray(each[0] + np.sum(self.lean**2 * each[1:], axis=0))

    def scaled(self, factor: float) -> Weights:
        """All of them times a factor."""
        return self if factor == 1.0 else replace(self, each=self.each * factor, short=self.short * factor)

    def sided(self, short: NDArray[np.bool_]) -> Weights:
        """With those of the clipped data (k,) counted that the prediction falls short of; itself if these did count."""
        if ((self.each[self.clipped] > 0.0) == short).all():
            return self
        each = self.each.copy()
        each[self.clipped] = np.where(short, self.short, 0.0)
        return replace(self, each=each)

    def change(self, before: Weights) -> float:
        """The squares of the shares by which these differ from others of the same data; inf if others of them count."""
        now, was = self.of_cells, before.of_cells
        if ((now[self.clipped] > 0.0) != (was[self.clipped] > 0.0)).any():
            return np.inf
        share, lean = (now - was) / np.maximum(was, 1e-300), (self.lean - before.lean).ravel()
        return float((1 + len(self.lean)) * share @ share + lean @ lean)

    def parts(self, rows: Floats) -> Iterator[tuple[Floats, Floats]]:
        """Rows of data (..., m) as parts (..., n) whose errors are independent, each with its weights (n,)."""
        n = self.lean.shape[1]
        means = rows[..., :n]
        yield means, self.each[:n]
        for s, lean in enumerate(self.lean, start=1):
            own, part = slice(s * n, s * n + n), lean * means
            yield np.subtract(rows[..., own], part, out=part), self.each[own]

    def apart(self, rows: Floats) -> Floats:
        """L times rows of data (..., m): their errors are independent, with `each` for weights."""
        return np.concatenate([part for part, _ in self.parts(rows)], axis=-1)

    def pulls(self, rows: Floats) -> Floats:
        """The weights, a symmetric matrix, times rows of data (..., m), at the means alone (..., n)."""
        (means, each), *slopes = self.parts(rows)
        result = means * each
        for lean, (slope, weight) in zip(self.lean, slopes, strict=True):
            slope *= lean * weight
            result -= slope
        return np.asarray(result)

    def times(self, rows: Floats) -> Floats:
        """The weights, a symmetric matrix, times rows of data (..., m)."""
        result = self.apart(rows) * self.each
        if self.lean.size:
            count = self.lean.shape[1]
            slopes = result[..., count:].reshape(*rows.shape[:-1], *self.lean.shape)
            result[..., :count] -= np.einsum("sn,...sn->...n", self.lean, slopes)
        return np.asarray(result)


def weights_of(data: ChannelCells, noise: Noise, channel: int, predicted: Floats) -> Weights:
    """Weights at the data that are predicted (m,); a clipped cell counts only where the prediction is below it."""
    n, per_cell = data.cells, 3 if data.slopes else 1
    signal, slopes = predicted[:n], predicted[n:].reshape(per_cell - 1, n)
    variance = noise.variance(signal, channel)
    each = data.count.reshape(per_cell, n) / variance
    clipped = np.flatnonzero(data.censored)
    short = each[0, clipped]
    if len(clipped):
        each[:, clipped] = 0.0
    lean = noise.variance(signal + slopes, channel)
    lean -= variance
    lean /= variance  # -1 or more: no variance is negative
    found = Weights(each=each.reshape(-1), lean=np.minimum(lean, 1.0, out=lean), clipped=clipped, short=short)
    return found.sided(predicted[clipped] < data.value[clipped]) if len(clipped) else found
