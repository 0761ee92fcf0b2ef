"""STEM.layers.exr: the best fit's pictures, on the sphere's box inside the window of the whole image."""

from __future__ import annotations

from pathlib import Path

from toolkit.io.exr_lines import write_lines
from toolkit.records import LinearImage, ModelLayers

LAYERS = ("diffuse", "specular", "model", "residual")


def write_layers(path: Path, layers: ModelLayers, image: LinearImage) -> None:
    """Write float32 scan lines, not packed; 0 off the sphere. One sample a quad where a mosaic was fitted.

    displayWindow is the image at the layers' resolution, dataWindow the sphere's box in it. Raises OSError where the
    disk does not take it.
    """
    x, y = (round((origin - (layers.step_px - 1) / 2) / layers.step_px) for origin in layers.origin_px)
    channels = {
        f"{name}.{letter}": getattr(layers, name)[..., channel]
        for name in LAYERS
        for channel, letter in enumerate("RGB")
    }
    display = image.width_px // layers.step_px, image.height_px // layers.step_px
    write_lines(path, channels, corner=(x, y), display=display)
