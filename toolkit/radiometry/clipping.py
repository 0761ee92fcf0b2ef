"""Which samples are clipped, which lie beside them, and which are no numbers: one uint8 of SampleFlag a sample."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag
from toolkit.records import Floats, RawFrame

PLACES = (0, 0), (0, 1), (1, 0), (1, 1)  # rows, columns of a mosaic's four parts
_CLIPPED, _BLOOM, _INVALID = (np.uint8(flag) for flag in (SampleFlag.CLIPPED, SampleFlag.BLOOM, SampleFlag.INVALID))
_MARGIN = 0.005  # of the range from black to white: a raw's saturation scatters by its read noise and gain
_LOWEST = 0.75  # of the range: where a sensor may saturate below the white level that its file states
_SPIKE = 5  # times as many samples in the uppermost `_MARGIN` as in the next: no unclipped brightness ends like that
_FEWEST = 20  # samples


def ceiling(frame: RawFrame, stored: Sequence[NDArray[Any]] | NDArray[Any]) -> Floats:
    """The stored level from which samples count as clipped, shaped like `frame.white`; inf where there is none.

    It is white, for raws half a percent of the range below it, or less where the samples `stored` (the frame's, or a
    part of them; of a mosaic's four places or of three channels in turn) pile up at a lower level: then that is where
    the sensor, or what wrote the file, clipped. That level must lie in the upper quarter of the range, or be all ones
    in fewer bits.
    """
    if not np.all(np.isfinite(frame.white)) or frame.encoding != "linear":
        return frame.white
    margin = _MARGIN * (frame.white - frame.black)
    level = frame.white - np.floor(margin) if frame.format == "raw" else frame.white.copy()
    for place, samples in zip(np.ndindex(level.shape), stored, strict=True):
        lowest = frame.black[place] + _LOWEST * (frame.white[place] - frame.black[place])
        level[place] = np.minimum(level[place], _pile_up(samples, float(lowest), float(margin[place])))
    return level


def _pile_up(samples: NDArray[Any], lowest: float, margin: float) -> float:
    """The level at which samples pile up, inf where they do not: a narrow spike at the very top, over `lowest`."""
    top = float(samples.max())
    all_ones = top > 0 and (int(top) + 1) & int(top) == 0  # 12 bits' ceiling in a file of 16
    if top < lowest and not all_ones:
        return float("inf")
    high = samples[samples > top - 2 * margin]
    in_spike = np.count_nonzero(high > top - margin)
    spike = in_spike >= _FEWEST and in_spike > _SPIKE * (high.size - in_spike + 1)
    return top - margin if spike else float("inf")


def mosaic_flags(parts: Sequence[NDArray[Any]], level: Floats) -> list[NDArray[np.uint8]]:
    """Flags of a mosaic's four parts, `PLACES`: clipped by the (2, 2) `level`, bloom 3 x 3 in the pixels and 3 x 3 in
    each part.
    """
    clipped = [_from(part, level[place]) for place, part in zip(PLACES, parts, strict=True)]
    if not any(each.any() for each in clipped):
        return [np.zeros(part.shape, np.uint8) for part in parts]
    whole = np.empty((len(parts[0]) + len(parts[2]), parts[0].shape[1] + parts[1].shape[1]), bool)
    for (row, column), each in zip(PLACES, clipped, strict=True):
        whole[row::2, column::2] = each
    flags, box = np.zeros(whole.shape, np.uint8), _around(whole, 2)
    flags[box] = _with_bloom(whole[box], _spread(whole[box], 1) | _spread(whole[box], 2))
    return [np.ascontiguousarray(flags[row::2, column::2]) for row, column in PLACES]


def _from(stored: NDArray[Any], level: float) -> NDArray[np.bool_]:
    """Which stored numbers are at least a level, whole ones compared as such: in a quarter of the bytes."""
    if stored.dtype.kind == "f":
        return np.asarray(stored >= level)
    within = level <= np.iinfo(stored.dtype).max
    return np.asarray(stored >= stored.dtype.type(np.ceil(level))) if within else np.zeros(stored.shape, bool)


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


def _around(clipped: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    """The box that holds all that is clipped, and as many pixels more to every side."""
    rows, columns = (np.flatnonzero(clipped.any(axis=axis)) for axis in (1, 0))
    top, left = (max(int(at[0]) - margin, 0) for at in (rows, columns))
    return slice(top, int(rows[-1]) + margin + 1), slice(left, int(columns[-1]) + margin + 1)


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
