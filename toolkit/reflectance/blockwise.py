"""Large arrays a block at a time, so that the many passes over them find them in the processor's cache."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import prod
from typing import Any

import numpy as np

from toolkit.records import Floats

BLOCK = 131_072  # elements: all nodes of a photograph, as a rule, which cutting would slow by a sixth

Piece = Callable[[Any], Any]  # cuts one block out of a number or an array that broadcasts to the whole


def blockwise(of: Callable[[Piece], tuple[Floats, ...]], whole: tuple[int, ...]) -> tuple[Floats, ...]:
    """The arrays that `of` makes of what it cuts with its piece, for all of `whole`; at once where that is small.

    Arrays that do not vary along the axis that is cut stay as short as they are.
    """
    axis = next((a for a in range(-len(whole), 0) if 2 * prod(whole) <= BLOCK * whole[a]), None)
    if axis is None or prod(whole) <= BLOCK:
        return of(lambda array: array)
    step = BLOCK * whole[axis] // prod(whole)
    made: list[Floats] = []
    for start in range(0, whole[axis], step):
        piece = partial(_cut, axis=axis, part=slice(start, start + step))
        parts = of(piece)
        made = made or [_room(part, axis, whole[axis]) for part in parts]
        for room, part in zip(made, parts, strict=True):
            np.asarray(piece(room))[...] = part
    return tuple(made)


def _cut(array: float | Floats, axis: int, part: slice) -> float | Floats:
    """A part of an array along an axis counted from the last; all of it where it does not vary along that."""
    values = np.asarray(array)
    if values.ndim < -axis or values.shape[axis] == 1:
        return array
    return np.asarray(values.swapaxes(axis, 0)[part].swapaxes(axis, 0))


def _room(part: Floats, axis: int, length: int) -> Floats:
    """An array to be filled with parts like this."""
    if part.ndim < -axis or part.shape[axis] == 1:
        return np.empty(part.shape, part.dtype)
    return np.empty((*part.shape[: part.ndim + axis], length, *part.shape[part.ndim + axis + 1 :]), part.dtype)
