"""A photograph's samples as one grid of pixels or quads, and their sums over blocks of 2, 4, 8 ... on a side.

The four planes of a mosaic share one grid: a quad is one of its places. Where nothing is flagged, as in most
photographs that were cut to their sphere, no pass is made over flags at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag, flagged
from toolkit.records import Floats, Plane

MOMENTS_FROM = 8  # pixels or quads on a side of the smallest blocks whose moments are worked out all over the image

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Centroid:
    """Mean place of a channel's samples about the centre of their pixel or quad, and their places' spread about it."""

    x_px: float
    y_px: float
    variance_px2: float  # along x, and as much along y
    product_px2: float  # mean of x y


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Per channel the mean value of each pixel or quad, filled up to whole blocks; and which are flagged, if any is."""

    value: NDArray[np.float32]  # (3, H, W)
    bad: Mask | None  # (3, H, W)
    clipped: Mask | None  # (3, H, W), of the bad ones those that are so only by being clipped
    size: tuple[int, int]  # height and width without what was filled up
    samples: tuple[int, int, int]  # of each channel in one pixel or quad
    centroids: tuple[Centroid, Centroid, Centroid]  # of each channel's samples in a pixel or quad
    origin_px: tuple[float, float]
    step_px: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Level:
    """Blocks of `side` pixels or quads on a side, as sums over parts of a side `part`; whether any is flagged."""

    side: int
    part: int
    sums: NDArray[np.float32]  # (3, 3, h, w): of the samples, of x times them, of y times them; single ones' own only
    bad: Mask | None
    size: tuple[int, int]  # of the photograph, in pixels or quads

    def told(self, row: Rows, column: Rows) -> Floats:
        """Of some blocks (3, 3, n): each channel's mean, and the slopes of its best plane along x and y, in steps."""
        width, count = self.sums.shape[-1], self.side // self.part
        down, along = np.divmod(np.arange(count**2), count)
        first = (row * width + column) * count
        parts = self.sums.reshape(len(self.sums) * 3, -1).take(first[:, None] + down * width + along, axis=1)
        if len(self.sums) > 1:  # moments of blocks: one part each
            result = parts.reshape(3, 3, -1).swapaxes(0, 1).astype(float)
        else:
            middle = (count - 1) / 2
            weight = np.stack([np.ones(count**2), along - middle, down - middle], axis=1).astype(np.float32)
            result = (parts @ weight).swapaxes(1, 2).astype(float)
        result /= self.side**2
        result[:, 1:] *= 12.0 / max(self.side**2 - 1.0, 1.0)
        return np.asarray(result)

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
    samples, centroids = [], []
    for c in range(3):
        mine = tuple(plane.origin_px for plane in planes if plane.channel == c)
        samples.append(len(mine))
        centroids.append(_centroid(mine, float(centre[0]), float(centre[1])))
    bad, clipped = _flags(planes, height, width, 2**levels)
    return Grid(
        value=_values(planes, height, width, 2**levels),
        bad=bad,
        clipped=clipped,
        size=(height, width),
        samples=(samples[0], samples[1], samples[2]),
        centroids=(centroids[0], centroids[1], centroids[2]),
        origin_px=(float(centre[0]), float(centre[1])),
        step_px=step,
    )


@lru_cache(maxsize=8)
def _centroid(places_px: tuple[tuple[float, float], ...], x_px: float, y_px: float) -> Centroid:
    """Of samples at these places about the centre x, y of their pixel or quad."""
    x, y = (np.array(places_px) - (x_px, y_px)).T
    return Centroid(
        x_px=float(x.mean()),
        y_px=float(y.mean()),
        variance_px2=float(0.5 * (x.var() + y.var())),
        product_px2=float((x * y).mean() - x.mean() * y.mean()),
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
        clipped[here] |= flagged(flags, SampleFlag.CLIPPED)
        invalid[here] |= flagged(flags, SampleFlag.INVALID)
    return bad, clipped & ~invalid


def pyramid(grid: Grid, levels: int) -> list[Level]:
    """Blocks of 1, 2 x 2, 4 x 4 ... up to 2^levels: the small ones by their pixels, the others by their own moments."""
    found = [Level(side=1, part=1, sums=grid.value[None], bad=grid.bad, size=grid.size)]
    for level in range(1, levels + 1):
        side, bad = 2**level, found[-1].bad
        if bad is not None:
            bad = bad[:, ::2] | bad[:, 1::2]
            bad = bad[..., ::2] | bad[..., 1::2]
        sums, part = found[0].sums, 1
        if side >= MOMENTS_FROM:
            sums, part = _moments(grid.value) if side == MOMENTS_FROM else _paired(found[-1]), side
        found.append(Level(side=side, part=part, sums=sums, bad=bad, size=grid.size))
    return found


def _moments(value: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums and first moments of blocks of MOMENTS_FROM on a side: two products of matrices, one pass over pixels."""
    side, (_, height, width) = MOMENTS_FROM, value.shape
    weight = np.stack([np.ones(side), np.arange(side) - (side - 1) / 2]).astype(np.float32)
    rows = weight @ value.reshape(3, height // side, side, width)
    both = rows.reshape(3, height // side, 2, width // side, side) @ weight.T
    return np.stack([both[:, :, 0, :, 0], both[:, :, 0, :, 1], both[:, :, 1, :, 0]])


def _paired(level: Level) -> NDArray[np.float32]:
    """Sums and first moments of blocks twice as wide: the parts' own, and their places times their sums."""
    sums, reach = level.sums, np.float32(level.side / 2)
    columns = sums[..., ::2, :] + sums[..., 1::2, :]
    down = sums[0, :, 1::2] - sums[0, :, ::2]
    left, right = columns[..., ::2], columns[..., 1::2]
    result = left + right
    result[1] += reach * (right[0] - left[0])
    result[2] += reach * (down[..., ::2] + down[..., 1::2])
    return np.asarray(result)
