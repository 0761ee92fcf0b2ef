"""STEM.layers.exr: the best fit's pictures, on the sphere's box inside the window of the whole image."""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np

from toolkit.records import Floats, LinearImage, ModelLayers

LAYERS = ("diffuse", "specular", "model", "residual")


def write_layers(path: Path, layers: ModelLayers, image: LinearImage) -> None:
    """Write float32 scan lines, not packed; 0 off the sphere. One sample a quad where a mosaic was fitted.

    displayWindow is the image at the layers' resolution, dataWindow the sphere's box in it. Raises OSError where the
    disk does not take it.
    """
    import OpenEXR

    height, width = layers.diffuse.shape[:2]
    x, y = (round((origin - (layers.step_px - 1) / 2) / layers.step_px) for origin in layers.origin_px)
    header = {
        "compression": OpenEXR.NO_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "displayWindow": _window(0, 0, image.width_px // layers.step_px, image.height_px // layers.step_px),
        "dataWindow": _window(x, y, width, height),
    }
    try:
        with OpenEXR.File(header, _channels(layers)) as file:
            file.write(str(path))
    except RuntimeError as error:  # all that OpenEXR says of a disk, which itself says why
        with path.open("ab") as file:
            file.write(bytes(layers.diffuse.nbytes))
        raise OSError(errno.EIO, "OpenEXR could not write the layers") from error


def _channels(layers: ModelLayers) -> dict[str, Floats]:
    found = {}
    for name in LAYERS:
        picture = getattr(layers, name)  # one at a time: some are made anew
        for channel, letter in enumerate("RGB"):
            found[f"{name}.{letter}"] = _dark(np.asarray(picture[..., channel], np.float32))
    return found


def _dark(layer: Floats) -> Floats:
    """The layer (h, w), 0 where it is no number."""
    return np.where(np.isfinite(layer), layer, np.float32(0.0))


def _window(x: int, y: int, width: int, height: int) -> tuple[Floats, Floats]:
    return np.array([x, y], np.int32), np.array([x + width - 1, y + height - 1], np.int32)
