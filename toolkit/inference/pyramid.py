"""A photograph's samples as one grid of pixels or quads, and their sums over blocks of 2, 4, 8 ... on a side.

The four planes of a mosaic share one grid: a quad is one of its places. Where nothing is flagged, as in most
photographs that were cut to their sphere, no pass is made over flags at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag, flagged
from toolkit.records import Floats, Plane

MOMENTS_FROM = 8  # pixels or quads on a side of the smallest blocks whose moments are worked out all over the image
_PLACES = np.array([np.ones(MOMENTS_FROM), np.arange(MOMENTS_FROM) - (MOMENTS_FROM - 1) / 2], np.float32)

Mask = NDArray[np.bool_]
Blocks = NDArray[np.intp]  # (2, n), rows and columns of blocks, counted in their own size


@dataclass(frozen=True, slots=True, kw_only=True)
class Centroid:
    """Mean place of a channel's samples about the centre of their pixel or quad, and their places' spread about it."""

    x_px: float
    y_px: float
    variance_px2: float  # along x, and as much along y
    product_px2: float  # mean of x y


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Per channel the mean value of each pixel or quad; and which are flagged, if any is, filled up to whole blocks."""

    value: tuple[NDArray[np.float32], ...]  # (H, W) of each channel
    bad: Mask | None  # (3, H, W)
    clipped: Mask | None  # (3, H, W), of the bad ones those that are so only by being clipped
    samples: tuple[int, int, int]  # of each channel in one pixel or quad
    centroids: tuple[Centroid, Centroid, Centroid]  # of each channel's samples in a pixel or quad
    origin_px: tuple[float, float]
    step_px: int

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels or quads."""
        height, width = self.value[0].shape
        return height, width


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Level:
    """Blocks of `side` pixels or quads on a side, as sums over parts of a side `part`; whether any is flagged."""

    side: int
    part: int
    sums: Sequence[NDArray[np.float32]]  # (m, h, w) of each channel: of samples, m = 1; of x and y times them as well
    bad: Mask | None
    size: tuple[int, int]  # of the photograph, in pixels or quads

    def moments(self, blocks: Blocks) -> Floats:
        """Of some whole blocks (3, 3, n): of each channel the sum of its samples, of x and of y times them.

        Places are in pixels or quads from the block's middle.
        """
        row, column = blocks
        width, count = self.sums[0].shape[-1], self.side // self.part
        first, table = (row * width + column) * count, [sums.reshape(len(sums), -1) for sums in self.sums]
        if self.part > 1:
            return np.array([sums.take(first, axis=1) for sums in table], float)
        inside, weight = _within(count, width)
        places = first + inside[:, None]
        return np.array([weight @ sums[0].take(places) for sums in table], float)

    def spoiled(self, blocks: Blocks) -> Mask:
        """Whether blocks hold anything flagged or reach over the edge: per channel (3, n), (1, n) if alike in all."""
        row, column = blocks
        height, width = (n // self.side for n in self.size)
        over = (row >= height) | (column >= width)
        return np.asarray(over[None] if self.bad is None else over | self.bad[:, row, column])


def grid_of(planes: tuple[Plane, ...], levels: int) -> Grid:
    """One grid of all planes; its flags are filled up to whole blocks of 2^levels."""
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
        value=tuple(_mean([p.values[:height, :width] for p in planes if p.channel == c]) for c in range(3)),
        bad=bad,
        clipped=clipped,
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


@lru_cache(maxsize=32)
def _within(count: int, width: int) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Of a block of `count` on a side: where its parts are from its first (n,), in rows of `width`; and 1, x and y of
    them from its middle (3, n).
    """
    down, along = np.indices((count, count)).reshape(2, -1)
    middle = (count - 1) / 2
    return down * width + along, np.array([np.ones(count**2), along - middle, down - middle], np.float32)


def _mean(values: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """The mean of planes of one channel; a single one as it is."""
    if len(values) == 1:
        return np.ascontiguousarray(values[0])
    total = values[0] + values[1]
    for more in values[2:]:
        total += more
    total *= np.float32(1 / len(values))
    return total


def _flags(planes: tuple[Plane, ...], height: int, width: int, block: int) -> tuple[Mask | None, Mask | None]:
    if not any(plane.flags[:height, :width].max(initial=0) for plane in planes):
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
    single = [value[None] for value in grid.value]
    found = [Level(side=1, part=1, sums=single, bad=grid.bad, size=grid.size)]
    for level in range(1, levels + 1):
        before, side = found[-1], 2**level
        part, sums, bad = 1, before.sums, before.bad
        if side == MOMENTS_FROM:
            part, sums = side, [_moments(value) for value in grid.value]
        elif side > MOMENTS_FROM:
            part, sums = side, [_paired(three, before.side) for three in before.sums]
        if bad is not None:
            bad = bad[:, ::2] | bad[:, 1::2]
            bad = bad[..., ::2] | bad[..., 1::2]
        found.append(Level(side=side, part=part, sums=sums, bad=bad, size=grid.size))
    return found


def _moments(value: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of whole blocks of MOMENTS_FROM on a side of samples (h, w): their sums, those of x and of y times them (3, ...).

    Two products of matrices, one pass over the pixels.
    """
    side = MOMENTS_FROM
    height, width = (n // side for n in value.shape)
    rows = _PLACES @ value[: height * side].reshape(height, side, value.shape[1])[..., : width * side]
    both = (rows.reshape(-1, side) @ _PLACES.T).reshape(height, 2, width, 2)
    return np.stack([both[:, 0, :, 0], both[:, 0, :, 1], both[:, 1, :, 0]])


def _paired(sums: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """The same of blocks twice as wide as those of `side`: the parts' own, and their places times their sums."""
    height, width = (n // 2 * 2 for n in sums.shape[1:])
    reach, above, below = np.float32(side / 2), sums[:, :height:2, :width], sums[:, 1:height:2, :width]
    columns, down = above + below, below[0] - above[0]
    left, right = columns[..., ::2], columns[..., 1::2]
    result = left + right
    result[1] += reach * (right[0] - left[0])
    result[2] += reach * (down[:, ::2] + down[:, 1::2])
    return np.asarray(result)
