"""The data that every fit works on: some thousand cells in the place of a million samples.

A cell is a square block of samples, small against everything that a lobe does there. What it says of a channel is the
plain mean of its samples and their two slopes, across and down, so nothing of it depends on a model or on weights. A
model predicts all three from its values at four nodes, which share the samples' first and second moments (their places
and the pixel's own box; Gauss's two-point rule along each axis). The four planes of a mosaic share their cells; each
channel has its own nodes there, about its own place in the 2 x 2 quad.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

SIDE_X = np.array([-1.0, 1.0, -1.0, 1.0])[:, None]  # the nodes' places about a cell's centre, in spreads
SIDE_Y = np.array([-1.0, -1.0, 1.0, 1.0])[:, None]
TOLD = 0.25 * np.stack([np.ones(4), SIDE_X[:, 0], SIDE_Y[:, 0]])  # mean and slopes, as sums of the values there


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelCells:
    """The data of one channel: the means of its n cells, then, where `slopes`, their slopes in x, then in y.

    A slope is the change over the nodes' spread, so that it is in units of radiance, like the means.
    """

    rows: NDArray[np.intp]  # (m,), the place that each datum belongs to; m is n, or 3 n with the slopes
    place: int  # which set of nodes is the channel's
    value: Floats  # (m,), radiance
    count: Floats  # (m,), samples that tell as much of it as the cell does
    censored: NDArray[np.bool_]  # (n,), clipped: the radiance is at least the value
    slopes: bool = True
    narrower: Floats | None = None  # (n,), the spread that slopes are told over in that of the nodes, where blurred

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def cells(self) -> int:
        """How many cells hold samples of this channel."""
        return len(self.censored)

    @property
    def means(self) -> Floats:
        """Mean radiance of each cell (n,)."""
        return self.value[: self.cells]

    @property
    def sharing(self) -> tuple[int, int, bool]:
        """The same for channels that are predicted alike from the same nodes."""
        return id(self.rows), self.place, self.slopes

    def predicted(self, nodes: Floats) -> Floats:
        """The data (..., m) of what has the values `nodes` (..., S, 4, N) at the nodes of all places."""
        return self.told(nodes[..., self.place, :, :])

    def told(self, here: Floats) -> Floats:
        """The data (..., m) of what has the values `here` (..., 4, N) at the nodes of the channel's own place.

        Of means without slopes the nodes may be any number.
        """
        n, nodes = self.cells, here.shape[-2]
        here = here if n == here.shape[-1] else here[..., self.rows[:n]]
        if not self.slopes:
            return here[..., 0, :] if nodes == 1 else np.asarray(np.full(nodes, 1.0 / nodes) @ here)
        found = TOLD @ here
        if self.narrower is not None:
            found[..., 1:, :] *= self.narrower
        return np.asarray(found.reshape(*here.shape[:-2], -1))

    def only(self, kept: NDArray[np.intp], rows: NDArray[np.intp], *, slopes: bool = True) -> ChannelCells:
        """Some of the cells (k,), at new places `rows` (k,), with their slopes or without."""
        times, shape = 3 if slopes and self.slopes else 1, (3 if self.slopes else 1, self.cells)
        return ChannelCells(
            rows=rows if times == 1 else np.tile(rows, times),
            place=self.place,
            value=self.value.reshape(shape)[:times].take(kept, axis=1).ravel(),
            count=self.count.reshape(shape)[:times].take(kept, axis=1).ravel(),
            censored=self.censored[kept],
            slopes=times == 3,
            narrower=None if self.narrower is None else self.narrower[kept],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Places of the cells (N,) and of their nodes (S, 4, N), in S sets, and the three channels' data on them."""

    x_px: Floats
    y_px: Floats
    node_x_px: Floats
    node_y_px: Floats
    channels: tuple[ChannelCells, ChannelCells, ChannelCells]

    def __post_init__(self) -> None:
        readonly(self)

    def nodes(self) -> tuple[Floats, Floats]:
        """Pixel coordinates x, y of the nodes of every cell, each (S, 4, N)."""
        return self.node_x_px, self.node_y_px

    def blurred(self, variance_px2: float) -> Cells:
        """The cells as a camera sees them that spreads each point by so much along each axis."""
        if variance_px2 <= 0.0:
            return self
        x, y = (nodes.mean(axis=1, keepdims=True) for nodes in self.nodes())
        wider = np.sqrt(1.0 + variance_px2 / (self.node_x_px - x) ** 2)
        narrower = (1.0 / wider).mean(axis=1)
        channels = [replace(data, narrower=narrower[data.place, data.rows[: data.cells]]) for data in self.channels]
        return replace(
            self,
            node_x_px=x + wider * (self.node_x_px - x),
            node_y_px=y + wider * (self.node_y_px - y),
            channels=(channels[0], channels[1], channels[2]),
        )

    def thinned(self, every: int) -> Cells:
        """The means of one cell in `every`, for a first search."""
        found: dict[int, tuple[NDArray[np.intp], NDArray[np.intp]]] = {}  # channels that share their rows go on so
        channels = []
        for data in self.channels:
            if id(data.rows) not in found:
                rows = data.rows[: data.cells]
                kept = np.flatnonzero(rows % every == 0)
                found[id(data.rows)] = kept, rows[kept] // every
            channels.append(data.only(*found[id(data.rows)], slopes=False))
        return Cells(
            x_px=self.x_px[::every],
            y_px=self.y_px[::every],
            node_x_px=np.ascontiguousarray(self.node_x_px[..., ::every]),
            node_y_px=np.ascontiguousarray(self.node_y_px[..., ::every]),
            channels=(channels[0], channels[1], channels[2]),
        )
