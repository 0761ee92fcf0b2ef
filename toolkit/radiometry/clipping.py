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
    return _with_bloom(clipped, _spread(clipped, 1) | _spread(clipped, 2))


def colour_flags(stored: NDArray[Any], level: Floats) -> NDArray[np.uint8]:
    """Flags (H, W, 3) of an RGB image: clipped by the (3,) `level`, bloom 3 x 3 around what any channel clips."""
    flags = np.zeros(stored.shape, np.uint8)
    if stored.dtype.kind == "f":
        flags[~np.isfinite(stored)] = _INVALID
    if not np.all(np.isfinite(level)):
        return flags
    clipped: NDArray[np.bool_] = stored >= level.astype(stored.dtype)
    if clipped.any():
        flags |= _with_bloom(clipped, _spread(np.any(clipped, axis=2), 1)[..., None])
    return flags


def _with_bloom(clipped: NDArray[np.bool_], near: NDArray[np.bool_]) -> NDArray[np.uint8]:
    return np.where(clipped, _CLIPPED, near * _BLOOM).astype(np.uint8)


def _spread(mask: NDArray[np.bool_], step: int) -> NDArray[np.bool_]:
    """The mask grown to the 3 x 3 neighbours that lie `step` pixels apart."""
    tall = mask.copy()
    tall[step:] |= mask[:-step]
    tall[:-step] |= mask[step:]
    grown = tall.copy()
    grown[:, step:] |= tall[:, :-step]
    grown[:, :-step] |= tall[:, step:]
    return grown
