"""Pictures (H, W, 3) as files that other programs read: OpenEXR in float32, PNG in 16 bits, both linear."""

from __future__ import annotations

import uuid
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats


def write_exr(path: Path, picture: Floats) -> None:
    """Write R, G, B as stored, in 32-bit floats."""
    import OpenEXR

    pixels = np.ascontiguousarray(picture, dtype=np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    part = _beside(path)
    try:
        OpenEXR.File(header, {"RGB": pixels}).write(str(part))
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def write_png(path: Path, codes: NDArray[np.uint16]) -> None:
    """Write 16-bit codes, R, G, B."""
    import cv2

    done, data = cv2.imencode(".png", codes[..., ::-1])
    if not done:
        raise OSError(f"{path.name}: the PNG could not be encoded")
    part = _beside(path)
    try:
        part.write_bytes(data.tobytes())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.stem}.{uuid.uuid4().hex}.part{path.suffix}")
