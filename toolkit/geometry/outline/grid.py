"""The planes of a photograph around a ball, brought down to the resolution that the next step works at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.flags import SampleFlag, flagged
from toolkit.records import Floats, LinearImage, Plane, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """One channel's samples (h, w) at origin_px + step_px * (column, row), NaN where unusable, with their noise."""

    values: Floats
    origin_px: tuple[float, float]
    step_px: float
    gain: float  # variance of a sample: gain * signal + read^2
    read: float

    def __post_init__(self) -> None:
        readonly(self)


def grids(image: LinearImage, box_px: tuple[float, float, float, float], step_px: float) -> tuple[Grid, ...]:
    """Every plane's part in the box (x0, y0, x1, y1), binned until its step is nearest to `step_px` or its own."""
    return tuple(_binned(image, plane, box_px, step_px) for plane in image.planes)


def _binned(image: LinearImage, plane: Plane, box_px: tuple[float, float, float, float], step_px: float) -> Grid:
    height, width = plane.values.shape
    (ox, oy), step = plane.origin_px, plane.step_px
    x0, x1 = (int(np.clip((v - ox) / step, 0, width)) for v in (box_px[0], box_px[2] + 1))
    y0, y1 = (int(np.clip((v - oy) / step, 0, height)) for v in (box_px[1], box_px[3] + 1))
    values = np.asarray(plane.values[y0:y1, x0:x1], np.float32)
    bad = flagged(plane.flags[y0:y1, x0:x1], SampleFlag.CLIPPED | SampleFlag.INVALID)
    if bad.any():
        values = values.copy()
        values[bad] = np.nan
    whole = Grid(
        values=values,
        origin_px=(ox + step * x0, oy + step * y0),
        step_px=float(step),
        gain=float(image.noise.gain[plane.channel]),
        read=float(image.noise.read[plane.channel]),
    )
    return _coarser(whole, step_px)


def coarser(planes: tuple[Grid, ...], step_px: float) -> tuple[Grid, ...]:
    """Planes binned further until their step is nearest to `step_px` or their own."""
    return tuple(_coarser(plane, step_px) for plane in planes)


def _coarser(grid: Grid, step_px: float) -> Grid:
    import cv2

    by = max(round(step_px / grid.step_px), 1)
    height, width = (side // by * by for side in grid.values.shape)
    if by == 1 or not height * width:
        return grid
    values = cv2.resize(grid.values[:height, :width], None, fx=1 / by, fy=1 / by, interpolation=cv2.INTER_AREA)
    shift = grid.step_px * (by - 1) / 2
    return Grid(
        values=np.asarray(values, np.float32),
        origin_px=(grid.origin_px[0] + shift, grid.origin_px[1] + shift),
        step_px=grid.step_px * by,
        gain=grid.gain / by**2,
        read=grid.read / by,
    )


def merged(planes: tuple[Grid, ...]) -> Grid:
    """The mean of planes of one shape, which lie within a sample of each other."""
    height, width = (min(p.values.shape[k] for p in planes) for k in (0, 1))
    many = len(planes)
    return Grid(
        values=np.mean([p.values[:height, :width] for p in planes], axis=0),
        origin_px=(
            float(np.mean([p.origin_px[0] for p in planes])),
            float(np.mean([p.origin_px[1] for p in planes])),
        ),
        step_px=planes[0].step_px,
        gain=float(np.mean([p.gain for p in planes])) / many,
        read=float(np.sqrt(np.mean([p.read**2 for p in planes]) / many)),
    )
