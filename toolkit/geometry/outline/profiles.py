"""Brightness against depth below the outline, from the picture's own samples: nothing is interpolated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, readonly

from .curve import depth_px, outline_px

BINS_PER_SAMPLE = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """A picture (h, w, channels) whose sample (row, column) of channel c lies at origin_px[c] + step_px * (column, row)."""

    values: Floats
    used: NDArray[np.bool_]  # (h, w)
    origin_px: Floats  # (channels, 2)
    step_px: float
    gain: Floats  # (channels,), of Noise
    read: Floats

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Profiles:
    """Means over narrow bins of depth, per channel and segment of the limb; depth in samples, positive inside."""

    azimuth_rad: Floats  # (segments,)
    place_px: Floats  # (segments, 2), on the outline
    normal: Floats  # (segments, 2), outward
    depth: Floats  # (channels, segments, bins), mean depth of the samples of a bin
    value: Floats  # (channels, segments, bins)
    count: Floats  # (channels, segments, bins)

    def __post_init__(self) -> None:
        readonly(self)


def profiles(grid: Grid, camera: Camera, shape: Floats, *, segments: int, length: float, reach: float) -> Profiles:
    """Profiles of `segments` stretches of the limb, each `length` samples long, to `reach` samples either side."""
    azimuth = (np.arange(segments) + 0.5) * (2 * np.pi / segments)
    place, normal = outline_px(camera, shape, azimuth)
    half = int(np.ceil(np.hypot(reach, 0.5 * length)))
    dy, dx = (d.ravel() for d in np.mgrid[-half : half + 1, -half : half + 1])
    bins = int(np.ceil(2 * reach * BINS_PER_SAMPLE))
    sums = [_channel(grid, c, camera, shape, place, normal, (dx, dy), length, reach, bins) for c in _channels(grid)]
    depth, value, count = (np.stack(s) for s in zip(*sums, strict=True))
    return Profiles(azimuth_rad=azimuth, place_px=place, normal=normal, depth=depth, value=value, count=count)


def _channels(grid: Grid) -> range:
    return range(grid.values.shape[2])


def _channel(
    grid: Grid,
    channel: int,
    camera: Camera,
    shape: Floats,
    place: Floats,
    normal: Floats,
    window: tuple[NDArray[Any], NDArray[Any]],
    length: float,
    reach: float,
    bins: int,
) -> tuple[Floats, Floats, Floats]:
    """Mean depth, mean value and count (segments, bins) of one channel."""
    height, width = grid.used.shape
    origin, step = grid.origin_px[channel], grid.step_px
    nearest = np.rint((place - origin) / step).astype(np.int64)
    column, row = nearest[:, :1] + window[0], nearest[:, 1:] + window[1]
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    column, row = np.clip(column, 0, width - 1), np.clip(row, 0, height - 1)
    x, y = origin[0] + step * column, origin[1] + step * row
    depth = depth_px(camera, shape, x, y) / step
    along = ((y - place[:, 1:]) * normal[:, :1] - (x - place[:, :1]) * normal[:, 1:]) / step
    inside &= (np.abs(along) <= 0.5 * length) & (np.abs(depth) < reach) & grid.used[row, column]
    bin_in = np.clip(np.floor((depth + reach) * BINS_PER_SAMPLE), 0, bins - 1).astype(np.int64)
    place_in = np.arange(len(place))[:, None] * bins + bin_in
    key, total = place_in[inside], len(place) * bins
    count = np.bincount(key, minlength=total).reshape(-1, bins).astype(float)
    safe = np.maximum(count, 1.0)
    mean_depth = np.bincount(key, depth[inside], total).reshape(-1, bins) / safe
    values = np.asarray(grid.values[row, column, channel], float)
    mean = np.bincount(key, values[inside], total).reshape(-1, bins) / safe
    return mean_depth, mean, count
