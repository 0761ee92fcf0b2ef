"""Pictures as PNG inside the page."""

from __future__ import annotations

import base64
import io

import numpy as np

from toolkit.records import Floats


def data_uri(rgb: Floats, opaque: np.ndarray | None = None) -> str:
    """A PNG of display values 0 .. 1 (h, w, 3) as data: address; transparent where `opaque` (h, w) is False."""
    from PIL import Image

    pixels = np.round(255 * np.clip(rgb, 0.0, 1.0)).astype(np.uint8)
    if opaque is not None:
        pixels = np.dstack([pixels, np.where(opaque, 255, 0).astype(np.uint8)])
    held = io.BytesIO()
    Image.fromarray(pixels).save(held, format="PNG", compress_level=6)
    return "data:image/png;base64," + base64.b64encode(held.getvalue()).decode("ascii")
