"""The EXIF orientation as array views: nothing is copied, and a mosaic's colour table turns with it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# How to bring stored rows and columns upright: (transpose, then flip rows, then flip columns), by EXIF code
# (EXIF 2.32, tag 274).
_STEPS = {
    1: (False, False, False),
    2: (False, False, True),
    3: (False, True, True),
    4: (False, True, False),
    5: (True, False, False),
    6: (True, False, True),
    7: (True, True, True),
    8: (True, True, False),
}
# LibRaw's sizes.flip: bit 0 mirrors columns, bit 1 mirrors rows, bit 2 swaps them, of the output's coordinates.
EXIF_OF_FLIP = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7}


def upright(stored: NDArray[Any], exif_code: int) -> NDArray[Any]:
    """The upright view of an array (H, W) or (H, W, C) stored with this EXIF code; unknown codes change nothing."""
    transpose, rows, columns = _STEPS.get(exif_code, _STEPS[1])
    turned = stored.swapaxes(0, 1) if transpose else stored
    return turned[:: -1 if rows else 1, :: -1 if columns else 1]


def upright_tile(tile: NDArray[Any], shape: tuple[int, int], exif_code: int) -> NDArray[Any]:
    """The upper left 2 x 2 of an upright mosaic whose stored (H, W) = `shape` begins with the 2 x 2 `tile`."""
    small = np.tile(tile, (2, 2))[: 2 + shape[0] % 2, : 2 + shape[1] % 2]  # parity of the sides is all that counts
    return np.ascontiguousarray(upright(small, exif_code)[:2, :2])
