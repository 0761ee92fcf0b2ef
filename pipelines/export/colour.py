"""Linear sRGB as a screen wants it."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats


def srgb_encode(linear: Floats) -> Floats:
    """Linear sRGB, clipped to 0 .. 1, through the sRGB curve (IEC 61966-2-1)."""
    clipped = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.power(np.maximum(clipped, 1e-9), 1 / 2.4) - 0.055)


def srgb_hex(linear: Floats) -> str:
    """Linear sRGB as #rrggbb."""
    r, g, b = np.round(255 * srgb_encode(np.asarray(linear, float))).astype(int)
    return f"#{r:02x}{g:02x}{b:02x}"
