"""Camera raws through LibRaw, read as a mosaic: no demosaic, no scaling, no clipping below black."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.io.decoded import CheckSize, Decoded
from toolkit.io.orientation import EXIF_OF_FLIP, upright, upright_tile

if TYPE_CHECKING:
    import rawpy

_CHANNEL = {"R": 0, "G": 1, "B": 2}


def decode(path: str, check_size: CheckSize) -> Decoded:
    """The visible mosaic of a raw file, or the three colours of a linear one.

    `check_size(width, height, bytes_per_pixel)` is asked before anything is unpacked.
    Raises BadInputError for sensors without a 2 x 2 red-green-blue mosaic and for files LibRaw cannot decode.
    """
    import rawpy

    with open(path, "rb") as file:  # noqa: PTH123  # pathlib costs the child's start-up
        if file.read(4) == b"FOVb":
            raise BadInputError("a Foveon raw; its layers are no red, green and blue: export it as 16-bit linear TIFF")
    try:
        raw = rawpy.RawPy()  # never closed: the pixels handed on are its own, and keep it
        raw.open_file(path)
        return _decode_open(raw, check_size)
    except rawpy.LibRawIOError as error:
        raise BadInputError(
            "the raw ends before its pixels do; it is cut short: copy it from the camera again"
        ) from error
    except rawpy.LibRawError as error:
        raise BadInputError(f"LibRaw cannot decode it ({_reason(error)}); export it as DNG, or 16-bit TIFF") from error


def _decode_open(raw: rawpy.RawPy, check_size: CheckSize) -> Decoded:
    size = raw.sizes  # known from the header alone
    check_size(size.raw_width, size.raw_height, 2)
    if size.pixel_aspect != 1.0:
        raise BadInputError(f"its pixels are {size.pixel_aspect:g} times as high as wide; square ones are needed")
    raw.unpack()
    return _mosaic(raw) if raw.raw_type.name == "Flat" else _linear_rgb(raw)


def _mosaic(raw: rawpy.RawPy) -> Decoded:
    colours = _colour_tile(raw)
    size = raw.sizes
    visible = raw.raw_image_visible
    code = EXIF_OF_FLIP.get(size.flip, 1)
    channel = np.array([_CHANNEL[letter] for letter in raw.color_desc.decode("ascii", "replace")])
    black = np.array(raw.black_level_per_channel, float)[colours]
    white = np.array(_white_levels(raw))[colours]
    shape = (visible.shape[0], visible.shape[1])
    return Decoded(
        format="raw",
        encoding="linear",
        values=upright(visible, code),
        cfa=upright_tile(channel[colours], shape, code).tolist(),
        black=upright_tile(black, shape, code).tolist(),
        white=upright_tile(white, shape, code).tolist(),
        metadata=_fields(raw),
    )


def _colour_tile(raw: rawpy.RawPy) -> NDArray[np.integer[Any]]:
    """LibRaw's colour indices (2, 2) of the first visible samples; refuses every other kind of mosaic."""
    description = raw.color_desc.decode("ascii", "replace")
    pattern = raw.raw_pattern
    if pattern is None or pattern.shape == (1, 1) or raw.num_colors == 1:
        raise BadInputError("a raw with one channel; three colours are needed: use a camera with a Bayer mosaic")
    if pattern.shape != (2, 2):
        raise BadInputError(
            f"a mosaic of {pattern.shape[0]} x {pattern.shape[1]} (X-Trans or another); a 2 x 2 Bayer mosaic is "
            "needed: convert it to a linear DNG or 16-bit TIFF"
        )
    top, left = raw.sizes.top_margin, raw.sizes.left_margin
    tile = np.array([[raw.raw_color(top + row, left + column) for column in (0, 1)] for row in (0, 1)])
    letters = sorted(description[index] for index in tile.ravel() if index < len(description))
    if letters != ["B", "G", "G", "R"]:
        raise BadInputError(f"a mosaic of {''.join(letters)}; one red, two green, one blue are needed")
    return tile


def _white_levels(raw: rawpy.RawPy) -> list[float]:
    """The level at which each colour index clips: the file's own per channel where it has one, else LibRaw's."""
    stated = raw.camera_white_level_per_channel
    level = float(raw.white_level)
    if stated is None:
        return [level] * 4
    return [float(s) if 0.5 * level < s <= level else level for s in stated]


def _linear_rgb(raw: rawpy.RawPy) -> Decoded:
    """A linear DNG or an sRAW: three colours a pixel already."""
    if raw.num_colors != 3:
        raise BadInputError(f"a raw of {raw.num_colors} colours a pixel; red, green and blue are needed")
    code = EXIF_OF_FLIP.get(raw.sizes.flip, 1)
    values = upright(raw.raw_image_visible, code)[..., :3]
    return Decoded(
        format="raw",
        encoding="linear",
        values=values,
        black=[float(level) for level in raw.black_level_per_channel[:3]],
        white=_white_levels(raw)[:3],
        metadata=_fields(raw),
    )


def _fields(raw: rawpy.RawPy) -> dict[str, Any]:
    """What LibRaw itself knows of the exposure and of the camera's colours; zero means unknown there."""
    try:
        other = raw.other
    except (ValueError, OverflowError, OSError):  # rawpy turns a damaged time stamp into a date
        return {}
    numbers = {"exposure_s": other.shutter_speed, "iso": other.iso_speed, "f_number": other.aperture}
    numbers["focal_length_mm"] = other.focal_length
    known = {name: float(value) for name, value in numbers.items() if np.isfinite(value) and value > 0}
    return {**known, **_colours(raw)}


def _colours(raw: rawpy.RawPy) -> dict[str, Any]:
    """LibRaw's own table for raws that are no DNG: XYZ to camera under D65, and the white balance as shot."""
    found: dict[str, Any] = {}
    matrix, balance = np.array(raw.rgb_xyz_matrix, float)[:3], np.array(raw.camera_whitebalance, float)[:3]
    if np.isfinite(matrix).all() and matrix.any():
        found["xyz_to_camera"] = matrix.tolist()
    if balance.shape == (3,) and np.isfinite(balance).all() and balance.min() > 0:
        found["as_shot_neutral"] = (balance.min() / balance).tolist()
    return found


def _reason(error: Exception) -> str:
    text = error.args[0] if error.args else error
    return text.decode("ascii", "replace") if isinstance(text, bytes) else str(text)
