"""Separation by colour alone, on the sphere's part of a photograph."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag
from toolkit.geometry.sphere import on_sphere
from toolkit.radiometry.quads import Quads
from toolkit.records import ColourLayers, Fit, Floats, LinearImage, ModelLayers, Scene

from .settings import Settings


def separate_colours(image: LinearImage, picture: Quads, scene: Scene, settings: Settings) -> ColourLayers | None:
    """What colour alone separates, with the light's colour as given, or as the photograph shows it."""
    if settings.separation.method == "none":
        return None
    from toolkit.separation import separate

    colour, source = _light_colour(scene, settings)
    row, column = np.ogrid[: picture.values.shape[0], : picture.values.shape[1]]
    (x0, y0), step = picture.origin_px, picture.step_px
    return separate(
        picture.values,
        variance=image.noise,
        usable=usable_samples(image),
        bloom=(picture.flags & SampleFlag.BLOOM) > 0,
        on_sphere=on_sphere(scene.camera, scene.sphere, x0 + step * column, y0 + step * row),
        light_colour=colour,
        light_source=source,
        origin_px=picture.origin_px,
        step_px=picture.step_px,
    )


def _light_colour(scene: Scene, settings: Settings) -> tuple[Floats, str]:
    if settings.separation.illuminant is not None:
        return np.array(settings.separation.illuminant), "given"
    if scene.scale == "absolute":
        return np.array(scene.lights[0].irradiance), "irradiance"
    return np.ones(3), "assumed white"


def usable_samples(image: LinearImage) -> NDArray[np.bool_]:
    """Per pixel or quad and channel, whether no sample is flagged (h, w, 3)."""
    height = min(plane.values.shape[0] for plane in image.planes)
    width = min(plane.values.shape[1] for plane in image.planes)
    usable = np.ones((height, width, 3), bool)
    for plane in image.planes:
        usable[..., plane.channel] &= plane.flags[:height, :width] == 0
    return usable


def layers_of_fit(image: LinearImage, picture: Quads, fit: Fit) -> ModelLayers:
    """The fit's own layers on the same grid, each channel where its samples lie."""
    from toolkit.inference.layers import layers_of

    places = np.array(
        [np.mean([p.origin_px for p in image.planes if p.channel == channel], axis=0) for channel in range(3)]
    )
    return layers_of(
        fit,
        picture.values,
        usable_samples(image),
        origin_px=picture.origin_px,
        step_px=picture.step_px,
        places_px=places - picture.origin_px,
    )
