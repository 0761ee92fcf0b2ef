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
    values = np.empty((3, height, width), np.float32)  # each channel lies together in memory
    flags = np.zeros((height, width), np.uint8)
    for channel in range(3):
        values[channel] = _mean([p for p in image.planes if p.channel == channel], height, width)
    for plane in image.planes:
        flags |= plane.flags[:height, :width]
    shift = (first.step_px - 1) / 2
    origin = (first.origin_px[0] + shift, first.origin_px[1] + shift)
    return Quads(values=np.moveaxis(values, 0, -1), flags=flags, origin_px=origin, step_px=first.step_px)


def usable_samples(image: LinearImage, rows: slice = np.s_[:]) -> NDArray[np.bool_]:
    """Per pixel or quad and channel, whether no sample is flagged (h, w, 3); of some rows of them."""
    height = min(plane.values.shape[0] for plane in image.planes)
    width = min(plane.values.shape[1] for plane in image.planes)
    usable = np.ones((3, len(range(height)[rows]), width), bool)
    for plane in image.planes:
        usable[plane.channel] &= plane.flags[:height, :width][rows] == 0
    return np.moveaxis(usable, 0, -1)


def at_one_place(image: LinearImage, picture: Quads) -> NDArray[np.float32]:
    """The image's own quads (h, w, 3), each sample moved to the middle of its quad by the slope around it.

    A quad's red and blue lie half a pixel to either side of its middle: where brightness changes from quad to quad
    their ratio is not the surface's, and the colours of a small ball tilt by a degree. The slope is that of the plane
    through the 3 x 3 samples of the channel around, which adds 1/50 to the noise of red and blue and leaves
    neighbours nearly independent; a sample with a flagged one among those stays where it is.
    """
    height, width = picture.values.shape[:2]
    moved = np.empty((3, height, width), np.float32)
    for channel in range(3):
        own = [plane for plane in image.planes if plane.channel == channel]
        x, y = np.mean([plane.origin_px for plane in own], axis=0)
        dx, dy = (picture.origin_px[0] - x) / picture.step_px, (picture.origin_px[1] - y) / picture.step_px
        values = np.ascontiguousarray(picture.values[..., channel])
        if dx or dy:
            foul = np.bitwise_or.reduce([plane.flags[:height, :width] for plane in own])
            _move(values, foul, dx, dy, moved[channel])
        else:
            moved[channel] = values
    return np.moveaxis(moved, 0, -1)


def _move(values: NDArray[np.float32], flags: NDArray[np.uint8], dx: float, dy: float, to: NDArray[np.float32]) -> None:
    """A layer (h, w) at (dx, dy) of its own samples aside, in `to`; flagged ones and those beside them stay."""
    import cv2  # slow to import, and only a mosaic's colours need it

    rise, row = np.array([-0.5, 0.0, 0.5]), np.full(3, 1 / 3)
    slope = dx * np.outer(row, rise) + dy * np.outer(rise, row)
    cv2.filter2D(values, -1, slope, to, borderType=cv2.BORDER_REFLECT_101)
    if flags.any():
        to[cv2.dilate(flags, np.ones((3, 3), np.uint8)) > 0] = 0
    to += values


def _mean(planes: list[Plane], height: int, width: int) -> NDArray[np.float32]:
    total = planes[0].values[:height, :width]
    for plane in planes[1:]:
        total = total + plane.values[:height, :width]
    return total if len(planes) == 1 else total * np.float32(1.0 / len(planes))
