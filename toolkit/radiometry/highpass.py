"""What local differences tell of an image: noise by the finest of them, structure by the coarser.

The 3 x 3 kernels are products of [1 1 1], [-1 0 1] and [1 -2 1] along rows and columns, scaled to unit norm. They are
orthogonal, so in white noise their answers are independent: choosing smooth places by some of them does not bias the
variance that the others measure. [1 -2 1] in both directions is Immerkaer's kernel (1996); it and its two neighbours
with [-1 0 1] see only the third and fourth derivatives of a smooth shading.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

OVERLAP = 1.9427  # sum of the squared correlations of `noise` with that of all samples around, for white noise
_TILE = 64  # samples a side


class Residuals(NamedTuple):
    """Flat arrays over samples; `noise` and `structure` have the noise's variance as mean where nothing else is."""

    signal: Floats  # mean of 3 x 3
    noise: Floats  # mean square of the three finest kernels
    structure: Floats  # mean square of second differences in rows or columns alone, over 5 x 5 samples
    tile: NDArray[np.intp]  # which tile each lies in


def residuals(values: NDArray[np.float32], usable: NDArray[np.bool_]) -> Residuals:
    """Of tiles (n, h, w), each at least 5 x 5; samples with a neighbour that is not `usable` (n, h, w) are left out."""
    sums, slopes, bends = _kernels(values, axis=1)
    signal, _, across = _kernels(sums, axis=2)
    _, _, sloped = _kernels(slopes, axis=2)
    down, twisted, finest = _kernels(bends, axis=2)
    structure = _mean_of_five(_mean_of_five((across * across + down * down) * np.float32(0.5), axis=1), axis=2)
    noise = (finest * finest + twisted * twisted + sloped * sloped) * np.float32(1 / 3)
    inner = (slice(None), slice(2, -2), slice(2, -2))  # where the mean of five reaches
    keep = _all_three(_all_three(usable, axis=1), axis=2)[inner]
    return Residuals(signal[inner][keep] * np.float32(1 / 3), noise[inner][keep], structure[keep], np.nonzero(keep)[0])


def tiles(array: NDArray[Any], most: int) -> NDArray[Any]:
    """Square tiles (n, side, side) of an array (h, w), evenly spread, of at most about `most` samples altogether."""
    height, width = array.shape
    side = min(_TILE, height, width)
    down, across = height // side, width // side
    grid = array[: down * side, : across * side].reshape(down, side, across, side).swapaxes(1, 2)
    count = min(down * across, max(most // (side * side), 1))
    chosen = np.linspace(0, down * across - 1, count).round().astype(int)
    return np.asarray(grid[chosen // across, chosen % across])


def _taps(values: NDArray[Any], axis: int, count: int) -> list[NDArray[Any]]:
    """The array shifted by 0, 1 .. `count` - 1 along `axis`, each as long as all of them reach."""
    length = values.shape[axis] - count + 1
    return [values[(slice(None),) * axis + (slice(start, start + length),)] for start in range(count)]


def _kernels(values: NDArray[np.float32], axis: int) -> list[NDArray[np.float32]]:
    """[1 1 1], [-1 0 1] and [1 -2 1] along one axis, of unit norm."""
    first, middle, last = _taps(values, axis, 3)
    ends = first + last
    return [
        (ends + middle) * np.float32(3**-0.5),
        (last - first) * np.float32(2**-0.5),
        (ends - 2 * middle) * np.float32(6**-0.5),
    ]


def _all_three(good: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    first, middle, last = _taps(good, axis, 3)
    return np.asarray(first & middle & last)


def _mean_of_five(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    taps = _taps(values, axis, 5)
    total = taps[0] + taps[1]
    for tap in taps[2:]:
        total += tap
    return np.asarray(total * np.float32(0.2))
