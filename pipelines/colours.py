"""Separation by colour alone, on the sphere's part of a photograph."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag, flagged
from toolkit.geometry.sphere import on_sphere
from toolkit.radiometry.quads import Quads, at_one_place, usable_samples
from toolkit.records import CameraColour, ColourLayers, Fit, LinearImage, Reference, Scene, Sphere

from .settings import Settings

if TYPE_CHECKING:
    from toolkit.separation import Illuminant

RIM = 2.0  # quads inside the outline: half a quad, and the blur of a lens
CHART_SD_DEG = 1.0  # the greys of a printed chart differ by as much


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """What a separation by colour looks at and no fit has a part in: h x w pixels, or quads of a mosaic."""

    values: NDArray[np.float32]  # (h, w, 3), each channel moved to the middle of its quad
    usable: NDArray[np.bool_]  # (h, w, 3)
    bloom: NDArray[np.bool_]  # (h, w)
    on_sphere: NDArray[np.bool_]  # (h, w)
    origin_px: tuple[float, float]
    step_px: int


def seen_by_colour(image: LinearImage, picture: Quads, scene: Scene) -> Seen:
    """A photograph as colour sees it."""
    row, column = np.ogrid[: picture.values.shape[0], : picture.values.shape[1]]
    (x0, y0), step = picture.origin_px, picture.step_px
    return Seen(
        values=at_one_place(image, picture),
        usable=usable_samples(image),
        bloom=flagged(picture.flags, SampleFlag.BLOOM),
        on_sphere=on_sphere(scene.camera, _inside(scene.sphere, image), x0 + step * column, y0 + step * row),
        origin_px=picture.origin_px,
        step_px=picture.step_px,
    )


def separate_colours(
    image: LinearImage,
    seen: Seen | None,
    scene: Scene,
    settings: Settings,
    fit: Fit,
    *,
    reference: Reference | None = None,
    colour: CameraColour | None = None,
) -> ColourLayers | None:
    """What colour alone separates; None where that is not asked for, without `seen`, or the photograph's colours cannot
    tell. It works in the place of `seen`'s values.

    The light's colour is the given one, a card's or a chart's, else what `fit` leaves as highlight, else the colours'
    own best guess.
    """
    if seen is None:
        return None
    from toolkit.separation import best_illuminant, separate

    values = seen.values
    values -= np.asarray(fit.colours["pedestal"], np.float32)  # black's error turns dim colours
    masks: dict[str, Any] = {
        "variance": image.noise,
        "usable": seen.usable,
        "bloom": seen.bloom,
        "on_sphere": seen.on_sphere,
    }
    try:
        white = image.metadata.as_shot_neutral
        light = best_illuminant(
            values,
            **masks,
            known=_known_illuminants(scene, settings, fit, reference, colour),
            camera_white=np.array(white) if len(white) == 3 else None,
        )
        return separate(
            values,
            **masks,
            light_colour=light.colour,
            light_covariance=light.covariance,
            light_source=light.source,
            light_reason=light.reason,
            origin_px=seen.origin_px,
            step_px=seen.step_px,
        )
    except BadInputError:  # too few colours that can be used: the fit has its own word on that
        return None


def _inside(sphere: Sphere, image: LinearImage) -> Sphere:
    """The sphere less a rim where a mosaic's quad sees the ball in some channels and what is behind it in others."""
    apart = len({plane.origin_px for plane in image.planes}) > 1
    return replace(sphere, radius_px=sphere.radius_px - RIM * image.planes[0].step_px) if apart else sphere


def _known_illuminants(
    scene: Scene, settings: Settings, fit: Fit, reference: Reference | None, colour: CameraColour | None
) -> list[Illuminant]:
    """The light's colour where the settings, a card, a chart, a known irradiance or the known shape tell it."""
    from toolkit.inference.light_colour import light_colour
    from toolkit.separation import CARD_SD_DEG, illuminant

    found = []
    if settings.separation.illuminant is not None:
        found.append(illuminant(np.array(settings.separation.illuminant), sd_deg=0.0, source="given"))
    if reference is not None:
        found.append(illuminant(reference.irradiance, sd_deg=CARD_SD_DEG, source="card", reason="the grey card"))
    elif scene.scale == "absolute":
        found.append(illuminant(np.array(scene.lights[0].irradiance), sd_deg=0.0, source="given"))
    if colour is not None and colour.white is not None:
        found.append(illuminant(colour.white, sd_deg=CHART_SD_DEG, source="card", reason="the colour chart's greys"))
    shown = None if found else light_colour(fit)
    return found if shown is None else [shown]
