"""PNG and Radiance through OpenCV, the rest (TGA, JPEG, BMP, WebP) through Pillow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.io import png
from toolkit.io.decoded import CheckSize, Decoded
from toolkit.io.orientation import upright

EXIF_ORIENTATION = 274


def decode_png(path: str, check_size: CheckSize) -> Decoded:
    """A PNG: 16 bits without a transfer curve are linear, everything else is encoded."""
    header = png.read_header(path)
    check_size(header.width, header.height, 3 * max(header.bits // 8, 1))
    values = three_colours(opencv(path))
    encoding = "linear" if header.bits == 16 and not header.transfer_named else "encoded"
    return integers("png", encoding, values)


def decode_radiance(path: str, check_size: CheckSize) -> Decoded:
    """A Radiance picture, decoded to float32 as stored."""
    lines, width, height = _radiance_header(path)
    check_size(width, height, 12)
    if any(b"32-bit_rle_xyze" in line for line in lines):
        raise BadInputError("a Radiance file in XYZ; RGB is needed: convert it with ra_xyze -r")
    scaled = [line for line in lines if line.startswith((b"EXPOSURE=", b"COLORCORR="))]
    notes = ["the Radiance header's EXPOSURE and COLORCORR were not divided out"] if scaled else []
    values = three_colours(opencv(path))
    if values.dtype != np.float32:
        raise BadInputError("a Radiance file that does not decode to floats; write it again as 32-bit_rle_rgbe")
    found = {"notes": notes} if notes else {}
    return Decoded("hdr", "linear", values, black=[0.0] * 3, white=[float("inf")] * 3, metadata=found)


def decode_other(path: str, check_size: CheckSize) -> Decoded:
    """TGA, JPEG, BMP and the like: 8 bits, encoded."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # check_size is asked before anything is decoded
    with Image.open(path, formats=("TGA", "JPEG", "BMP", "WEBP", "PPM")) as image:
        check_size(*image.size, 3)
        code = int(image.getexif().get(EXIF_ORIENTATION, 1))
        if image.mode in ("1", "L", "LA", "I", "I;16", "F"):
            raise BadInputError("an image with one channel; three colours are needed")
        values = np.asarray(image.convert("RGB"))
    return integers("image", "encoded", np.ascontiguousarray(upright(values, code)))


def integers(kind: str, encoding: str, values: NDArray[Any]) -> Decoded:
    """An integer image: black at 0, white at the type's ceiling."""
    ceiling = float(np.iinfo(values.dtype).max)
    return Decoded(format=kind, encoding=encoding, values=values, black=[0.0] * 3, white=[ceiling] * 3)


def three_colours(values: NDArray[Any]) -> NDArray[Any]:
    """RGB of an OpenCV array (B, G, R and perhaps alpha)."""
    if values.ndim != 3 or values.shape[2] not in (3, 4):
        raise BadInputError("an image with one channel; three colours are needed")
    return np.ascontiguousarray(values[..., 2::-1])


def opencv(path: str) -> NDArray[Any]:
    import cv2

    values = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if values is None:
        raise BadInputError("OpenCV cannot decode it; the file is damaged: copy or export it again")
    return np.asarray(values)


def _radiance_header(path: str) -> tuple[list[bytes], int, int]:
    """Lines, width and height of a Radiance picture in the usual order of rows ("-Y height +X width")."""
    with open(path, "rb") as file:  # noqa: PTH123  # pathlib costs the child's start-up
        head = file.read(65_536)
    end = head.find(b"\n\n")
    words = head[end + 2 :].split(b"\n", 1)[0].split() if end >= 0 else []
    if len(words) == 4 and words[0] == b"-Y" and words[2] == b"+X" and words[1].isdigit() and words[3].isdigit():
        return head[:end].splitlines(), int(words[3]), int(words[1])
    raise BadInputError(
        "a Radiance file without a '-Y height +X width' line; write it again in the usual order of rows"
    )
