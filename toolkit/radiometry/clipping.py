"""Which samples are clipped, which lie beside them, and which are no numbers: one uint8 of SampleFlag a sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag
from toolkit.records import Floats, RawFrame

_CLIPPED, _BLOOM, _INVALID = (np.uint8(flag) for flag in (SampleFlag.CLIPPED, SampleFlag.BLOOM, SampleFlag.INVALID))
_RAW_MARGIN = 0.005  # of the range from black to white: a raw's saturation scatters by its read noise and gain


def ceiling(frame: RawFrame) -> Floats:
    """The stored level from which samples count as clipped, shaped like `frame.white`; inf where there is none."""
    if frame.format != "raw":
        return frame.white
    return frame.white - np.floor(_RAW_MARGIN * (frame.white - frame.black))


def mosaic_flags(stored: NDArray[Any], level: Floats) -> NDArray[np.uint8]:
    """Flags (H, W) of a mosaic: clipped by the (2, 2) `level`, bloom 3 x 3 in the pixels and 3 x 3 in each plane."""
    clipped = np.empty(stored.shape, bool)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        np.greater_equal(stored[row::2, column::2], level[row, column], out=clipped[row::2, column::2])
    if not clipped.any():
        return np.zeros(stored.shape, np.uint8)
    return _with_bloom(clipped, _spread(clipped, 1) | _spread(clipped, 2, only_even=True))


def colour_flags(stored: NDArray[Any], level: Floats) -> NDArray[np.uint8]:
    """Flags (H, W, 3) of an RGB image: clipped by the (3,) `level`, bloom 3 x 3 around what any channel clips."""
    flags = np.zeros(stored.shape, np.uint8)
    if stored.dtype.kind == "f":
        flags[~np.isfinite(stored)] = _INVALID
    clipped: NDArray[np.bool_] = stored >= level.astype(stored.dtype if np.all(np.isfinite(level)) else np.float32)
    if clipped.any():
        flags |= _with_bloom(clipped, _spread(np.any(clipped, axis=2), 1)[..., None])
    return flags


def _with_bloom(clipped: NDArray[np.bool_], near: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return np.where(clipped, _CLIPPED, near * _BLOOM).astype(np.uint8)


def _spread(mask: NDArray[np.bool_], reach: int, *, only_even: bool = False) -> NDArray[np.bool_]:
    """The mask grown by `reach` pixels in rows and columns; with `only_even` by exactly `reach`, within its plane."""
    grown = mask.copy()
    for step in (reach,) if only_even else range(1, reach + 1):
        grown[step:] |= mask[:-step]
        grown[:-step] |= mask[step:]
    wide = grown.copy()
    for step in (reach,) if only_even else range(1, reach + 1):
        wide[:, step:] |= grown[:, :-step]
        wide[:, :-step] |= grown[:, step:]
    return wide
