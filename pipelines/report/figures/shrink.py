"""Pictures small enough for a page: means over blocks, so that noise shrinks and nothing is invented."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, ModelLayers, readonly

MOST_PX = 400  # width and height of a picture on the page


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Small:
    """The layers as (h, w, 3) means over `factor` x `factor` samples; NaN where there are none.

    `residual` is of the samples that no flag spoils.
    """

    photograph: Floats
    diffuse: Floats
    specular: Floats
    model: Floats
    residual: Floats
    factor: int
    origin_px: tuple[float, float]  # of the layers themselves, as step_px
    step_px: int

    def __post_init__(self) -> None:
        readonly(self)


def small(layers: ModelLayers) -> Small:
    """The layers at most 400 pixels wide and high."""
    factor = max(1, -(-max(layers.diffuse.shape[0], layers.diffuse.shape[1]) // MOST_PX))
    return Small(
        photograph=shrunk(layers.photograph, factor),
        diffuse=shrunk(layers.diffuse, factor),
        specular=shrunk(layers.specular, factor),
        model=shrunk(layers.model, factor),
        residual=shrunk(np.where(layers.used, layers.residual, np.float32(np.nan)), factor),
        factor=factor,
        origin_px=layers.origin_px,
        step_px=layers.step_px,
    )


def shrunk(values: Floats, factor: int) -> Floats:
    """Means over blocks of `factor` x `factor` pixels of (h, w, ...), of what is finite in each."""
    h, w = values.shape[0] // factor, values.shape[1] // factor
    tiles = [
        values[row : h * factor : factor, column : w * factor : factor]
        for row in range(factor)
        for column in range(factor)
    ]
    total, count = np.zeros(tiles[0].shape), np.zeros(tiles[0].shape, np.int32)
    for tile in tiles:
        seen = np.isfinite(tile)
        np.add(total, tile, out=total, where=seen)
        count += seen
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))
