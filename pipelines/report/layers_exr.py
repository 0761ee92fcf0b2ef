"""STEM.layers.exr: the best fit's pictures, on the sphere's box inside the window of the whole image."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.records import Floats, LinearImage, ModelLayers

from .scanlines import write_lines

if TYPE_CHECKING:
    from pipelines.drawing import Lines

LAYERS = ("diffuse", "model", "residual", "specular")  # by name, as are the channels of each: OpenEXR's order
LETTERS = "BGR"


def write_layers(path: Path, layers: ModelLayers, image: LinearImage, *, lines: Lines | None = None) -> None:
    """Write float32 scan lines, not packed; 0 off the sphere. One sample a quad where a mosaic was fitted.

    `lines(rows)` gives some of the layers once they are there, of what is still being drawn.
    displayWindow is the image at the layers' resolution, dataWindow the sphere's box in it. Raises OSError where the
    disk does not take it.
    """
    height, width = layers.diffuse.shape[:2]
    x, y = (round((origin - (layers.step_px - 1) / 2) / layers.step_px) for origin in layers.origin_px)

    def fill(rows: slice, to: Floats) -> None:
        part = (lines or layers.lines)(rows)
        for planes, name in zip(np.split(to, len(LAYERS), axis=1), LAYERS, strict=True):
            planes[...] = np.moveaxis(getattr(part, name)[..., ::-1], -1, 1)
        np.copyto(to, 0.0, where=~np.isfinite(to))

    write_lines(
        path,
        [f"{name}.{letter}" for name in LAYERS for letter in LETTERS],
        fill,
        data=(x, y, x + width - 1, y + height - 1),
        display=(0, 0, image.width_px // layers.step_px - 1, image.height_px // layers.step_px - 1),
    )
