"""For lobes that keep a table per tuple of shape numbers: one call a tuple, whatever shapes broadcast to."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from toolkit.records import Floats

from .cosines import Number

Flat = tuple[Floats, ...]  # arrays (N,), of directions


def per_shape(of: Callable[..., Floats], directions: Sequence[Floats], shape: Sequence[Number]) -> Floats:
    """`of(flat directions, *shape)`, which returns (k, N), for arrays of any shape: (k, *what all broadcast to)."""
    numbers = np.broadcast_arrays(*shape)
    parts: list[Floats] = list(np.broadcast_arrays(*directions, *numbers))
    flat = tuple(part.ravel() for part in parts[: len(directions)])
    if numbers[0].size == 1:
        whole = of(flat, *(float(number.flat[0]) for number in numbers))
        return whole.astype(flat[0].dtype, copy=False).reshape(-1, *parts[0].shape)
    tuples, place = np.unique(np.stack([part.ravel() for part in parts[len(flat) :]]), axis=1, return_inverse=True)
    results = [of(tuple(part[place.ravel() == i] for part in flat), *map(float, t)) for i, t in enumerate(tuples.T)]
    whole = np.empty((len(results[0]), flat[0].size), flat[0].dtype)
    for number, result in enumerate(results):
        whole[:, place.ravel() == number] = result
    return whole.reshape(-1, *parts[0].shape)
