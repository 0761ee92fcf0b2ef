"""The sRGB curve, inverted exactly (IEC 61966-2-1:1999, section 5.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats


def decode_srgb(encoded: Floats) -> Floats:
    """Linear values of sRGB-encoded ones, both in 0..1, same shape."""
    low = encoded <= 0.04045
    return np.where(low, encoded / 12.92, ((np.where(low, 0.04045, encoded) + 0.055) / 1.055) ** 2.4)


def srgb_to_linear(stored: NDArray[Any]) -> NDArray[np.float32]:
    """Linear float32 of unsigned integers that encode 0..1 by the sRGB curve; looked up in a table."""
    ceiling = int(np.iinfo(stored.dtype).max)
    table = decode_srgb(np.arange(ceiling + 1) / ceiling).astype(np.float32)
    return np.asarray(table[stored])
