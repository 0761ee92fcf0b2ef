"""The weights of a channel's data: the inverse of their covariance, cell by cell.

The noise grows with the signal, so on the brighter side of a cell it is larger, and an error of the mean comes with one
of the slopes. A slope less what the mean tells of its error is independent of it: the inverse covariance of a cell is
L^T diag(each) L with L = (1, 0, 0; -lean_x, 1, 0; -lean_y, 0, 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, Noise, readonly

from .cells import ChannelCells


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weights:
    """Of the m data of one channel: one over each one's own variance, 0 where it counts for nothing."""

    each: Floats  # (m,)
    lean: Floats  # (2, n), error of the slopes in x and in y for each unit of the mean's; (0, n) without slopes

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def counted(self) -> int:
        """How many data count."""
        return int(np.count_nonzero(self.each))

    def scaled(self, factor: float) -> Weights:
        """All of them times a factor."""
        return self if factor == 1.0 else Weights(each=self.each * factor, lean=self.lean)

    def apart(self, rows: Floats) -> Floats:
        """L times rows of data (..., m): their errors are independent, with `each` for weights."""
        if not self.lean.size:
            return rows
        result, means = rows.copy(), rows[..., None, : self.lean.shape[1]]
        slopes = result[..., self.lean.shape[1] :].reshape(*rows.shape[:-1], *self.lean.shape)
        slopes -= self.lean * means
        return result

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
    n = data.cells
    signal, slopes = predicted[:n], predicted[n:].reshape(-1, n)
    variance = noise.variance(signal, channel)
    each = data.count.reshape(-1, n) / variance
    if data.censored.any():
        each[0, data.censored & (signal >= data.means)] = 0.0
        each[1:, data.censored] = 0.0
    lean = (noise.variance(signal + slopes, channel) - variance) / variance
    return Weights(each=each.ravel(), lean=np.clip(lean, -1.0, 1.0))
