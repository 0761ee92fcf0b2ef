"""One RGB picture at a mosaic's quad resolution, for display, detection and colour clusters; never for the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import LinearImage, Plane, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quads:
    """Pixel (row, column) lies at origin_px + step_px * (column, row): the middle of its 2 x 2 samples."""

    values: NDArray[np.float32]  # (h, w, 3)
    flags: NDArray[np.uint8]  # (h, w), SampleFlag of any sample of the quad or pixel
    origin_px: tuple[float, float]
    step_px: int

    def __post_init__(self) -> None:
        readonly(self)


def quads(image: LinearImage) -> Quads:
    """The image as RGB: a mosaic's 2 x 2 samples together, its greens averaged; an RGB image as it is."""
    first = image.planes[0]
    height = min(plane.values.shape[0] for plane in image.planes)
    width = min(plane.values.shape[1] for plane in image.planes)
    values = np.empty((height, width, 3), np.float32)
    flags = np.zeros((height, width), np.uint8)
    for channel in range(3):
        values[..., channel] = _mean([p for p in image.planes if p.channel == channel], height, width)
    for plane in image.planes:
        flags |= plane.flags[:height, :width]
    shift = (first.step_px - 1) / 2
    origin = (first.origin_px[0] + shift, first.origin_px[1] + shift)
    return Quads(values=values, flags=flags, origin_px=origin, step_px=first.step_px)


def _mean(planes: list[Plane], height: int, width: int) -> NDArray[np.float32]:
    total = planes[0].values[:height, :width]
    for plane in planes[1:]:
        total = total + plane.values[:height, :width]
    return total if len(planes) == 1 else total * np.float32(1.0 / len(planes))
