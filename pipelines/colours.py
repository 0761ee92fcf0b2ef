"""Separation by colour alone, on the sphere's part of a photograph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag
from toolkit.geometry.sphere import on_sphere
from toolkit.radiometry.quads import Quads
from toolkit.records import ColourLayers, Fit, LinearImage, ModelLayers, Scene

from .settings import Settings

if TYPE_CHECKING:
    from toolkit.separation import Illuminant


def separate_colours(image: LinearImage, picture: Quads, scene: Scene, settings: Settings) -> ColourLayers | None:
    """What colour alone separates; None where that is not asked for, or the photograph's colours cannot tell."""
    if settings.separation.method == "none":
        return None
    from toolkit.separation import best_illuminant, separate

    row, column = np.ogrid[: picture.values.shape[0], : picture.values.shape[1]]
    (x0, y0), step = picture.origin_px, picture.step_px
    seen: dict[str, Any] = {
        "variance": image.noise,
        "usable": usable_samples(image),
        "bloom": (picture.flags & SampleFlag.BLOOM) > 0,
        "on_sphere": on_sphere(scene.camera, scene.sphere, x0 + step * column, y0 + step * row),
    }
    try:
        white = image.metadata.as_shot_neutral
        light = best_illuminant(
            picture.values,
            **seen,
            known=_known_illuminant(scene, settings),
            camera_white=np.array(white) if len(white) == 3 else None,
        )
        return separate(
            picture.values,
            **seen,
            light_colour=light.colour,
            light_covariance=light.covariance,
            light_source=light.source,
            origin_px=picture.origin_px,
            step_px=picture.step_px,
        )
    except BadInputError:  # too few colours that can be used: the fit has its own word on that
        return None


def _known_illuminant(scene: Scene, settings: Settings) -> list[Illuminant]:
    """The light's colour where the settings or a known irradiance give it."""
    from toolkit.separation import illuminant

    given = settings.separation.illuminant or (scene.lights[0].irradiance if scene.scale == "absolute" else None)
    return [] if given is None else [illuminant(np.array(given), sd_deg=0.0, source="given")]


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
