"""For lobes that keep a table per tuple of shape numbers: one call a tuple, whatever shapes broadcast to."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from toolkit.records import Floats

from .cosines import Number

Flat = tuple[Floats, ...]  # arrays (N,), of directions


def per_shape(of: Callable[..., Floats], directions: Sequence[Floats], shape: Sequence[Number]) -> Floats:
    """`of(flat directions, *shape)`, which returns (k, N), for arrays of any shape: (k, *what all broadcast to).

    Of the kind that the directions are. Equal tuples follow each other, so that a table need not be kept for long.
    """
    numbers = np.broadcast_arrays(*shape)
    whole = np.broadcast_shapes(numbers[0].shape, *(part.shape for part in directions))
    places = (1,) * (len(whole) - numbers[0].ndim) + numbers[0].shape
    everywhere = [np.broadcast_to(part, whole) for part in directions]
    tuples, found = np.stack([number.ravel() for number in numbers]), np.empty((0, *whole))
    for place in np.lexsort(tuples):
        at = zip(np.unravel_index(place, places), places, strict=True)
        piece = tuple(slice(i, i + 1) if many > 1 else slice(None) for i, many in at)
        here = [part[piece] for part in everywhere]
        values = of(tuple(part.ravel() for part in here), *map(float, tuples[:, place]))
        found = found if len(found) else np.empty((len(values), *whole), directions[0].dtype)
        found[:, *piece] = values.reshape(-1, *here[0].shape)
    return found
