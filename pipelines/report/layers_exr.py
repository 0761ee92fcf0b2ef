"""STEM.layers.exr: the best fit's pictures, on the sphere's box inside the window of the whole image."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.records import Floats, LinearImage, ModelLayers

from .scanlines import Scanlines

LAYERS = ("diffuse", "model", "residual", "specular")  # by name, as are the channels of each: OpenEXR's order
LETTERS = "BGR"


@dataclass(frozen=True, slots=True, kw_only=True)
class LayersFile:
    """The file while it is made: float32 scan lines, not packed; 0 off the sphere. One sample a quad of a mosaic.

    displayWindow is the image at the layers' resolution, dataWindow the sphere's box in it.
    """

    lines: Scanlines

    @classmethod
    def begin(cls, path: Path, layers: ModelLayers, image: LinearImage) -> LayersFile:
        """Of layers that need not be drawn yet. Raises OSError where the disk does not take it."""
        height, width = layers.diffuse.shape[:2]
        x, y = (round((origin - (layers.step_px - 1) / 2) / layers.step_px) for origin in layers.origin_px)
        lines = Scanlines(
            path=path,
            channels=tuple(f"{name}.{letter}" for name in LAYERS for letter in LETTERS),
            data=(x, y, x + width - 1, y + height - 1),
            display=(0, 0, image.width_px // layers.step_px - 1, image.height_px // layers.step_px - 1),
        )
        lines.begin()
        return cls(lines=lines)

    def write(self, layers: ModelLayers, rows: slice) -> None:
        """Write some rows of the layers. Raises OSError where the disk does not take them."""

        def fill(few: slice, to: Floats) -> None:
            part = layers.lines(few)
            for planes, name in zip(np.split(to, len(LAYERS), axis=1), LAYERS, strict=True):
                planes[...] = np.moveaxis(getattr(part, name)[..., ::-1], -1, 1)
            np.copyto(to, 0.0, where=~np.isfinite(to))

        self.lines.write(rows, fill)


def write_layers(path: Path, layers: ModelLayers, image: LinearImage) -> None:
    """Write layers that are there. Raises OSError where the disk does not take them."""
    LayersFile.begin(path, layers, image).write(layers, slice(0, len(layers.used)))
