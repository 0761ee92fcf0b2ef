"""The samples beside the outline, in stretches of it: what the limb is measured on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, readonly

from .cone import depth_px
from .grid import Grid

MOST = 150  # samples of a plane in one stretch: more are drawn from
ENOUGH = 2  # times as many


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretches:
    """Samples of each plane in each stretch, (planes x stretches, n), padded where `there` is False."""

    x_px: Floats
    y_px: Floats
    value: Floats
    there: NDArray[np.bool_]
    stretch: NDArray[np.int64]  # (planes x stretches,)
    gain: Floats  # (planes x stretches, 1), of the noise
    read: Floats  # (planes x stretches, 1)
    level: Floats  # (planes x stretches, 1), brightness that the ball reaches in the plane
    step_px: float
    count: int  # stretches

    def __post_init__(self) -> None:
        readonly(self)


def stretches(
    grids: tuple[Grid, ...],
    camera: Camera,
    shape: Floats,
    *,
    count: int,
    inside: float,
    outside: float,
    rng: np.random.Generator,
) -> Stretches:
    """Samples to `inside` and `outside` px from the outline of `shape`, in `count` stretches of equal azimuth."""
    rows = [_of_plane(grid, camera, shape, count, inside, outside, rng) for grid in grids]
    x, y, value, there = (np.concatenate([row[i] for row in rows]) for i in range(4))
    used = int(np.count_nonzero(there, axis=1).max(initial=1))
    gain, read, level = (
        np.repeat(numbers, count)[:, None]
        for numbers in ([g.gain for g in grids], [g.read for g in grids], [level_of(g, shape) for g in grids])
    )
    return Stretches(
        x_px=x[:, :used],
        y_px=y[:, :used],
        value=value[:, :used],
        there=there[:, :used] > 0,
        stretch=np.tile(np.arange(count), len(grids)),
        gain=gain,
        read=read,
        level=level,
        step_px=grids[0].step_px,
        count=count,
    )


def level_of(grid: Grid, shape: Floats) -> float:
    """What the ball's brighter parts reach, and no less than the noise."""
    (cx, cy), r = (shape[:2] - grid.origin_px) / grid.step_px, shape[2] / grid.step_px
    box = grid.values[max(int(cy - r), 0) : max(int(cy + r), 0), max(int(cx - r), 0) : max(int(cx + r), 0)]
    seen = box[np.isfinite(box)]
    return max(float(np.percentile(seen, 90)) if len(seen) else 0.0, 3 * grid.read, 1e-9)


def _of_plane(
    grid: Grid, camera: Camera, shape: Floats, count: int, inside: float, outside: float, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats, Floats]:
    """Places, values, and 1 where there is a sample (count, MOST)."""
    height, width = grid.values.shape
    x = grid.origin_px[0] + grid.step_px * np.arange(width)
    y = grid.origin_px[1] + grid.step_px * np.arange(height)
    depth = depth_px(camera, shape, x[None, :], y[:, None])
    near = np.flatnonzero((depth < inside) & (depth > -outside) & np.isfinite(grid.values))
    lot = rng.random(height * width)[near]
    few = lot < ENOUGH * MOST * count / max(len(near), 1)  # far more than will be drawn need not be put in order
    near, lot = near[few], lot[few]
    row, column = np.divmod(near, width)
    x, y, value = x[column], y[row], np.asarray(grid.values[row, column], float)
    turn = np.arctan2(y - shape[1], x - shape[0]) / (2 * np.pi) % 1.0
    stretch = np.minimum((turn * count).astype(np.int64), count - 1)
    order = np.lexsort((lot, stretch))
    x, y, value, stretch = x[order], y[order], value[order], stretch[order]
    place = np.arange(len(x)) - np.searchsorted(stretch, stretch)
    keep = place < MOST
    size = (count, MOST)
    padded = [np.full(size, shape[0] + shape[2]), np.full(size, shape[1]), np.zeros(size), np.zeros(size)]
    for target, source in zip(padded, (x, y, value, np.ones_like(x)), strict=True):
        target[stretch[keep], place[keep]] = source[keep]
    return padded[0], padded[1], padded[2], padded[3]
