"""From stored numbers to radiance: black subtracted, white scaled to one, clipped samples flagged; nothing clipped.

Units are those of the image: a raw's (DN - black) / (white - black), 16-bit files over 65535, EXR and Radiance as
stored. A mosaic stays a mosaic.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import UsageError
from toolkit.radiometry import clipping, transfer_curve
from toolkit.radiometry.noise import noise_of
from toolkit.radiometry.noise_estimate import Disc
from toolkit.records import LinearImage, Noise, Plane, RawFrame

Box = tuple[int, int, int, int]
Transfer = Literal["srgb"]


def linearise(
    frame: RawFrame,
    *,
    box: Box | None = None,
    transfer: Transfer | None = None,
    noise: Noise | None = None,
    disc: Disc | None = None,
) -> LinearImage:
    """The frame as measurements: four planes of step 2 for a mosaic, three of step 1 otherwise, float32.

    `box` (x0, y0, x1, y1), end exclusive, limits the planes to those pixels, grown to whole 2 x 2 cells of a mosaic;
    `width_px` and `height_px` stay the full frame's. `noise` overrides the file's profile and the estimate; `disc`
    (x, y, radius) is where a smooth sphere is seen, from which that is best made.
    Non-finite samples become 0 with the flag INVALID. An encoded image needs `transfer`: it is linearised by that
    curve and marked; without it, or with it on raws and float images, UsageError is raised.
    """
    _check_transfer(frame, transfer)
    height, width = frame.values.shape[:2]
    x0, y0, x1, y1 = _whole_cells(box or (0, 0, width, height), width, height)
    stored = frame.values[y0:y1, x0:x1]
    planes = _mosaic(frame, stored, (x0, y0)) if frame.cfa is not None else _colours(frame, stored, (x0, y0), transfer)
    return LinearImage(
        name=frame.name,
        sha256=frame.sha256,
        width_px=width,
        height_px=height,
        planes=planes,
        noise=noise_of(planes, frame.metadata, given=noise, disc=disc),
        white=1.0 if np.all(np.isfinite(frame.white)) else float("inf"),
        transfer_assumed=transfer is not None,
        metadata=frame.metadata,
    )


def _check_transfer(frame: RawFrame, transfer: Transfer | None) -> None:
    if frame.encoding == "encoded" and transfer is None:
        raise UsageError(
            f"{frame.name}: the image is 8-bit or names a transfer curve; linear radiance is needed: pass a raw, EXR "
            "or 16-bit linear file, or --transfer srgb to assume the sRGB curve"
        )
    if transfer is not None and (frame.cfa is not None or frame.values.dtype.kind == "f"):
        raise UsageError(f"{frame.name}: a {frame.format} file is linear already; leave out --transfer {transfer}")


def _whole_cells(box: Box, width: int, height: int) -> Box:
    x0, y0, x1, y1 = box
    x0, y0 = max(x0 - x0 % 2, 0), max(y0 - y0 % 2, 0)
    x1, y1 = min(x1 + x1 % 2, width), min(y1 + y1 % 2, height)
    if x1 - x0 < 2 or y1 - y0 < 2:
        raise UsageError(f"the box {box} holds no pixels of an image of {width} x {height}")
    return x0, y0, x1, y1


def _mosaic(frame: RawFrame, stored: NDArray[np.uint16], origin: tuple[int, int]) -> tuple[Plane, ...]:
    assert frame.cfa is not None  # noqa: S101  # the caller chose by it
    # taken apart once: all that follows is several times faster along memory
    parts = [np.ascontiguousarray(stored[row::2, column::2]) for row, column in clipping.PLACES]
    flags = clipping.mosaic_flags(parts, clipping.ceiling(frame, parts))
    return tuple(
        Plane(
            channel=int(frame.cfa[place]),
            values=_scaled(part, float(frame.black[place]), float(frame.white[place])),
            flags=own,
            origin_px=(float(origin[0] + place[1]), float(origin[1] + place[0])),
            step_px=2,
        )
        for place, part, own in zip(clipping.PLACES, parts, flags, strict=True)
    )


def _colours(
    frame: RawFrame, stored: NDArray[Any], origin: tuple[int, int], transfer: Transfer | None
) -> tuple[Plane, ...]:
    flags = clipping.colour_flags(stored, clipping.ceiling(frame, np.moveaxis(stored, -1, 0)))
    planes = []
    for channel in range(3):
        values = _radiance(frame, stored[..., channel], channel, transfer)
        if values.dtype.kind == "f" and not np.isfinite(frame.white[channel]):
            values = np.where(np.isfinite(values), values, np.float32(0.0))
        planes.append(
            Plane(
                channel=channel,
                values=values,
                flags=np.ascontiguousarray(flags[..., channel]),
                origin_px=(float(origin[0]), float(origin[1])),
                step_px=1,
            )
        )
    return tuple(planes)


def _radiance(frame: RawFrame, stored: NDArray[Any], channel: int, transfer: Transfer | None) -> NDArray[np.float32]:
    if transfer is not None:
        return transfer_curve.srgb_to_linear(stored)
    return _scaled(stored, float(frame.black[channel]), float(frame.white[channel]))


def _scaled(stored: NDArray[Any], black: float, white: float) -> NDArray[np.float32]:
    """(stored - black) / (white - black) in one float32 array, unclipped."""
    values = np.array(stored, np.float32, order="C")
    if np.isfinite(white):
        values -= np.float32(black)
        values *= np.float32(1.0 / (white - black))
    return values
