"""A photograph's samples as one grid of pixels or quads, and their sums over blocks of 2, 4, 8 ... on a side.

The four planes of a mosaic share one grid: a quad is one of its places. Where nothing is flagged, as in most
photographs that were cut to their sphere, no pass is made over flags at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag
from toolkit.records import Floats, Plane

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Per channel the mean value of each pixel or quad, filled up to whole blocks; and which are flagged, if any is."""

    value: NDArray[np.float32]  # (3, H, W)
    bad: Mask | None  # (3, H, W)
    clipped: Mask | None  # (3, H, W), of the bad ones those that are so only by being clipped
    size: tuple[int, int]  # height and width without what was filled up
    samples: tuple[int, int, int]  # of each channel in one pixel or quad
    first: tuple[Floats, Floats, Floats]  # per channel, mean place x, y about the centre, and mean of x y
    origin_px: tuple[float, float]
    step_px: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Level:
    """Blocks of `side` pixels or quads on a side: their sums (3, h, w), and whether any of theirs is flagged."""

    side: int
    sums: NDArray[np.float32]
    bad: Mask | None
    size: tuple[int, int]  # of the photograph, in pixels or quads

    def means(self, row: Rows, column: Rows) -> Floats:
        """Mean of some blocks per channel (3, n)."""
        return np.asarray(self.sums[:, row, column] / np.float32(self.side**2))

    def spoiled(self, row: Rows, column: Rows) -> Mask:
        """Whether blocks hold anything flagged or reach over the edge, per channel (3, n)."""
        over = ((row + 1) * self.side > self.size[0]) | ((column + 1) * self.side > self.size[1])
        return np.broadcast_to(over, (3, len(row))) if self.bad is None else over | self.bad[:, row, column]


def grid_of(planes: tuple[Plane, ...], levels: int) -> Grid:
    """One grid of all planes, its sides whole blocks of 2^levels."""
    height = min(plane.values.shape[0] for plane in planes)
    width = min(plane.values.shape[1] for plane in planes)
    corner = np.min([plane.origin_px for plane in planes], axis=0)
    step = planes[0].step_px
    centre = corner + (step - 1) / 2
    samples, first = [], []
    for c in range(3):
        mine = [plane for plane in planes if plane.channel == c]
        x, y = (np.array([plane.origin_px for plane in mine]) - centre).T
        samples.append(len(mine))
        first.append(np.array([x.mean(), y.mean(), (x * y).mean()]))
    bad, clipped = _flags(planes, height, width, 2**levels)
    return Grid(
        value=_values(planes, height, width, 2**levels),
        bad=bad,
        clipped=clipped,
        size=(height, width),
        samples=(samples[0], samples[1], samples[2]),
        first=(first[0], first[1], first[2]),
        origin_px=(float(centre[0]), float(centre[1])),
        step_px=step,
    )


def _values(planes: tuple[Plane, ...], height: int, width: int, block: int) -> NDArray[np.float32]:
    value = np.empty((3, height + -height % block, width + -width % block), np.float32)
    value[:, height:], value[:, :, width:] = 0.0, 0.0
    for c in range(3):
        here, mine = value[c, :height, :width], [p.values[:height, :width] for p in planes if p.channel == c]
        if len(mine) == 1:
            here[...] = mine[0]
        else:
            np.add(mine[0], mine[1], out=here)
            for more in mine[2:]:
                here += more
            here *= np.float32(1 / len(mine))
    return value


def _flags(planes: tuple[Plane, ...], height: int, width: int, block: int) -> tuple[Mask | None, Mask | None]:
    if not any(plane.flags[:height, :width].any() for plane in planes):
        return None, None
    shape = (3, height + -height % block, width + -width % block)
    bad, clipped, invalid = np.ones(shape, bool), np.zeros(shape, bool), np.zeros(shape, bool)
    bad[:, :height, :width] = False
    for plane in planes:
        flags, here = plane.flags[:height, :width], (plane.channel, slice(height), slice(width))
        bad[here] |= flags != 0
        clipped[here] |= (flags & SampleFlag.CLIPPED) > 0
        invalid[here] |= (flags & SampleFlag.INVALID) > 0
    return bad, clipped & ~invalid


def pyramid(grid: Grid, levels: int) -> list[Level]:
    """Sums of 1, 2 x 2, 4 x 4 ... up to 2^levels."""
    found = [Level(side=1, sums=grid.value, bad=grid.bad, size=grid.size)]
    for level in range(1, levels + 1):
        total, bad = found[-1].sums, found[-1].bad
        total = total[:, ::2] + total[:, 1::2]
        total = total[..., ::2] + total[..., 1::2]
        if bad is not None:
            bad = bad[:, ::2] | bad[:, 1::2]
            bad = bad[..., ::2] | bad[..., 1::2]
        found.append(Level(side=2**level, sums=total, bad=bad, size=grid.size))
    return found
