"""The photograph with what was found drawn over it: outline, centre, highlight, samples clipped or in glare."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipelines.report.figures.shrink import shrunk
from pipelines.report.figures.tone import BRIGHT_BODY, Tone
from toolkit.flags import SampleFlag, flagged
from toolkit.geometry.project import limb_px
from toolkit.radiometry.colour import camera_colour
from toolkit.radiometry.quads import Quads
from toolkit.records import Floats, Metadata, readonly

from .records import Examination

MOST_PX = 1000  # width and height of the frame's picture
CLOSE_PX = 700  # about, of the ball's
AROUND = 1.25  # ball radii that the close picture shows
OUTLINE, HIGHLIGHT = (0, 200, 255), (255, 215, 0)  # sRGB; the page names them too
CLIPPED, GLARE = (255, 0, 200), (255, 120, 0)
SUBPIXEL = 4  # bits of OpenCV's fixed-point coordinates


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawn:
    """One picture (h, w, 3), 8-bit sRGB, and the part of the frame that it shows: origin and size of its pixels."""

    rgb: NDArray[np.uint8]
    origin_px: tuple[float, float]
    step_px: float

    def __post_init__(self) -> None:
        readonly(self)


def frame_picture(found: Examination, whole: Quads) -> Drawn:
    """The whole frame, shrunk."""
    factor = max(1, -(-max(whole.values.shape[:2]) // MOST_PX))
    step, shift = whole.step_px * factor, whole.step_px * (factor - 1) / 2
    origin = whole.origin_px[0] + shift, whole.origin_px[1] + shift
    shown = _tone(found, whole).show(shrunk(whole.values, factor))
    return _drawn(found, shown, _marked(whole.flags, factor), origin, step)


def close_picture(found: Examination, whole: Quads) -> Drawn | None:
    """The ball alone, large; small ones with their pixels to be seen. None where there is no ball."""
    if found.scene is None:
        return None
    x, y = limb_px(found.scene.camera, found.scene.sphere).T
    middle, reach = np.array([x.mean(), y.mean()]), AROUND * max(np.ptp(x), np.ptp(y)) / 2
    first = np.floor((middle - reach - whole.origin_px) / whole.step_px).astype(int)
    last = np.ceil((middle + reach - whole.origin_px) / whole.step_px).astype(int) + 1
    (x0, y0), (x1, y1) = np.maximum(first, 0), np.maximum(last, 1)
    values, flags = whole.values[y0:y1, x0:x1], whole.flags[y0:y1, x0:x1]
    if not values.size:
        return None
    factor = max(1, round(max(values.shape[:2]) / CLOSE_PX))
    times = max(1, round(CLOSE_PX / max(values.shape[:2])))
    shown = np.repeat(np.repeat(_tone(found, whole).show(shrunk(values, factor)), times, 0), times, 1)
    marked = np.repeat(np.repeat(_marked(flags, factor), times, 0), times, 1)
    step = whole.step_px * factor / times
    corner = np.asarray(whole.origin_px) + whole.step_px * np.array([x0, y0]) - whole.step_px / 2 + step / 2
    return _drawn(found, shown, marked, (float(corner[0]), float(corner[1])), step)


def _marked(flags: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Per block of `factor` x `factor` pixels CLIPPED where it holds a clipped sample, else GLARE where such a one."""

    def holds(kind: SampleFlag) -> NDArray[np.bool_]:
        return np.asarray(shrunk(flagged(flags, kind).astype(np.float32), factor) > 0.0)

    marked = holds(SampleFlag.GLARE) * np.uint8(SampleFlag.GLARE)
    return np.where(holds(SampleFlag.CLIPPED), np.uint8(SampleFlag.CLIPPED), marked)


def png_bytes(picture: Drawn) -> bytes:
    """The picture as a PNG file."""
    import io

    from PIL import Image

    held = io.BytesIO()
    Image.fromarray(picture.rgb).save(held, format="PNG", compress_level=6)
    return held.getvalue()


def _tone(found: Examination, whole: Quads) -> Tone:
    """White balance as shot; bright parts of the ball, or of the frame, well exposed."""
    metadata = found.frame.metadata
    neutral = _neutral(metadata)
    colour = camera_colour(metadata, light=neutral)
    matrix = (np.eye(3) if colour is None else colour.to_srgb) / neutral
    body = whole.values[:: max(len(whole.values) // 400, 1), :: max(len(whole.values) // 400, 1)].reshape(-1, 3)
    bright = float(np.percentile((body @ matrix.T).max(axis=1), 99))
    if found.exposure is not None and found.exposure.of == "ball":
        bright = 1.3 * float((matrix @ found.exposure.body).max())
    return Tone(matrix=matrix * (BRIGHT_BODY / bright if bright > 0.0 else 1.0), in_srgb=colour is not None)


def _neutral(metadata: Metadata) -> Floats:
    neutral = np.asarray(metadata.as_shot_neutral, float)
    usable = neutral.shape == (3,) and np.isfinite(neutral).all() and neutral.min() > 0.0
    return np.asarray(neutral / neutral.max()) if usable else np.ones(3)


def _drawn(
    found: Examination, shown: Floats, marked: NDArray[np.uint8], origin: tuple[float, float], step: float
) -> Drawn:
    canvas = np.ascontiguousarray(np.round(255 * shown).astype(np.uint8))
    canvas[marked == SampleFlag.CLIPPED], canvas[marked == SampleFlag.GLARE] = CLIPPED, GLARE
    if found.scene is not None:
        _outline(canvas, found, origin, step)
    if found.lamp is not None:
        _highlights(canvas, found, origin, step)
    return Drawn(rgb=canvas, origin_px=origin, step_px=step)


def _outline(canvas: NDArray[np.uint8], found: Examination, origin: tuple[float, float], step: float) -> None:
    import cv2

    assert found.scene is not None  # noqa: S101  # the caller looked
    limb = limb_px(found.scene.camera, found.scene.sphere)
    cv2.polylines(canvas, [_fixed(limb, origin, step)], True, OUTLINE, 1, cv2.LINE_AA, SUBPIXEL)
    _cross(canvas, found.scene.sphere.centre_px, origin, step, OUTLINE, arm=9.0, turned=False)


def _highlights(canvas: NDArray[np.uint8], found: Examination, origin: tuple[float, float], step: float) -> None:
    import cv2

    assert found.lamp is not None  # noqa: S101  # the caller looked
    if found.lamp.expected_px is not None:
        centre = _fixed(np.array([found.lamp.expected_px]), origin, step)[0]
        cv2.circle(canvas, _pair(centre), 14 << SUBPIXEL, HIGHLIGHT, 2, cv2.LINE_AA, SUBPIXEL)
    if found.lamp.seen_px is not None:
        _cross(canvas, found.lamp.seen_px, origin, step, HIGHLIGHT, arm=7.0, turned=True)


def _cross(
    canvas: NDArray[np.uint8],
    place: tuple[float, float],
    origin: tuple[float, float],
    step: float,
    colour: tuple[int, int, int],
    *,
    arm: float,
    turned: bool,
) -> None:
    import cv2

    along = np.array([(1.0, 1.0), (1.0, -1.0)]) if turned else np.array([(1.0, 0.0), (0.0, 1.0)])
    for way in along:
        ends = _fixed(np.array(place) + arm * step * np.array([-way, way]), origin, step)
        cv2.line(canvas, _pair(ends[0]), _pair(ends[1]), colour, 2, cv2.LINE_AA, SUBPIXEL)


def _fixed(places: Floats, origin: tuple[float, float], step: float) -> NDArray[np.int32]:
    """Pixel coordinates of the frame as the picture's own, in OpenCV's fixed point, within what it can hold."""
    own = (places - np.asarray(origin)) / step * (1 << SUBPIXEL)
    return np.asarray(np.round(np.clip(own, -(2**24), 2**24)), np.int32)


def _pair(place: Any) -> tuple[int, int]:  # noqa: ANN401  # two numbers of an array
    return int(place[0]), int(place[1])
