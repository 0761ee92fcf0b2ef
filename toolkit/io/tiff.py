"""TIFF through tifffile: 16-bit and float samples are linear unless the file names a transfer curve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.io import icc, raster
from toolkit.io.decoded import CheckSize, Decoded
from toolkit.io.orientation import upright

if TYPE_CHECKING:
    import tifffile

_ICC_PROFILE = 34675
_TRANSFER_FUNCTION = 301
_EXIF, _COLOUR_SPACE_SRGB = 34665, 1


def decode(path: str, check_size: CheckSize) -> Decoded:
    """The first page as RGB (H, W, 3): uint8, uint16 or float32.

    Raises BadInputError for one-channel, palette or CMYK pages and other sample types; tifffile raises on damage.
    """
    import tifffile

    with tifffile.TiffFile(path) as file:
        page = file.pages.first
        _check_page(page)
        check_size(page.imagewidth, page.imagelength, page.samplesperpixel * np.dtype(page.dtype).itemsize)
        values = _rgb(path, page)
        code = int(page.tags[274].value) if 274 in page.tags else 1
        encoding = "encoded" if values.dtype == np.uint8 or _names_a_curve(page) else "linear"
    values = np.ascontiguousarray(upright(values, code))
    if values.dtype == np.float32:
        return Decoded(format="tiff", encoding=encoding, values=values, black=[0.0] * 3, white=[float("inf")] * 3)
    return raster.integers("tiff", encoding, values)


def _check_page(page: tifffile.TiffPage) -> None:
    if page.samplesperpixel < 3:
        raise BadInputError("a TIFF with one channel; three colours are needed")
    if page.photometric != 2:
        raise BadInputError(
            f"a TIFF of kind {getattr(page.photometric, 'name', page.photometric)}; plain RGB is needed: convert it"
        )
    if page.dtype not in (np.dtype("u1"), np.dtype("u2"), np.dtype("f2"), np.dtype("f4")):
        raise BadInputError(f"a TIFF of {page.dtype} samples; 16-bit integers or 32-bit floats are needed")


def _rgb(path: str, page: tifffile.TiffPage) -> NDArray[Any]:
    """The page's first three samples a pixel, in native byte order."""
    try:
        values = page.asarray()
    except ValueError as error:
        if "imagecodecs" not in str(error):
            raise
        return raster.three_colours(raster.opencv(path))  # LZW and others that tifffile leaves to a package
    if page.planarconfig == 2:
        values = np.moveaxis(values, 0, -1)
    values = values[..., :3]
    native = np.dtype(np.float32) if values.dtype.kind == "f" else values.dtype.newbyteorder("=")
    return np.asarray(values, native)


def _names_a_curve(page: tifffile.TiffPage) -> bool:
    """By its ICC profile, its TransferFunction, or EXIF's ColorSpace."""
    if _ICC_PROFILE in page.tags:
        return not icc.is_linear(bytes(page.tags[_ICC_PROFILE].value))
    exif = page.tags[_EXIF].value if _EXIF in page.tags else {}
    srgb = isinstance(exif, dict) and exif.get("ColorSpace") == _COLOUR_SPACE_SRGB
    return srgb or _TRANSFER_FUNCTION in page.tags
