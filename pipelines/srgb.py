"""The material's colours in linear sRGB and XYZ, and where the camera's own are known from.

An albedo is a reflectance a channel: radiance over irradiance, both in the same camera's channels, so that white
balance is done. Where the irradiance is not known the albedo still carries the light's colour; it is divided out, the
green channel left as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import BadInputError, FitMaterialError
from toolkit.records import (
    CameraColour,
    ColourLayers,
    Estimate,
    Fit,
    Floats,
    MaterialReport,
    Metadata,
    Photograph,
    RawFrame,
    Scene,
    readonly,
)

from .files import chart_file

if TYPE_CHECKING:
    from .settings import Settings

REFLECTANCES = ("diffuse_albedo", "reflectance_factor", "specular_albedo", "specular_strength", "specular_f0")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Srgb:
    """One reflectance in linear sRGB (3,), its sd (3,), in XYZ under D65 (3,); `hex` only of an absolute scale."""

    estimate: Floats
    sd: Floats
    xyz: Floats
    hex: str | None

    def __post_init__(self) -> None:
        readonly(self)


def chart_of(frame: RawFrame, path: Path, settings: Settings) -> CameraColour | None:
    """The camera's colours by the chart in the photograph that the settings name, the ball's own or another, if any.

    Raises BadInputError for a photograph that cannot be used.
    """
    other = chart_file(settings, path.parent)
    if other is None:
        return None
    from toolkit.io.read import read
    from toolkit.radiometry.chart import colour_of_chart, find_chart
    from toolkit.radiometry.linearise import linearise
    from toolkit.radiometry.quads import quads

    if not other.is_file():
        raise BadInputError(f"colour.chart {other} does not exist; expected a photograph of a 24-patch chart")
    own = frame if other.samefile(path) else read(other)
    try:
        picture = quads(linearise(own, transfer=settings.image.transfer))
        found = colour_of_chart(find_chart(picture.values, picture.flags == 0))
    except FitMaterialError as error:
        raise BadInputError(f"{own.name}: {error}") from error
    return replace(found, chart_sha256=own.sha256)


def colour_of(metadata: Metadata, scene: Scene, separation: ColourLayers | None) -> CameraColour | None:
    """The camera's colours by the file's matrices under this light; None where it has none."""
    from toolkit.radiometry.colour import camera_colour

    return camera_colour(metadata, light=light_colour(scene, separation, metadata))


def light_colour(scene: Scene, separation: ColourLayers | None, metadata: Metadata) -> Floats | None:
    """The light's colour in camera channels (3,), its largest 1; None where nothing tells.

    From the irradiance, else what separation took (a card, a chart, the highlight), else the camera's white balance.
    """
    told = [getattr(light, "irradiance", None) for light in scene.lights[:1]]
    told += [] if separation is None else [separation.light_colour]
    for given in (*told, metadata.as_shot_neutral):
        colour = np.asarray(() if given is None else given, float)
        if colour.shape == (3,) and np.isfinite(colour).all() and colour.min() > 0.0:
            return np.asarray(colour / colour.max())
    return None


def light_of(one: Photograph | MaterialReport) -> Floats:
    """The light's colour (3,) of a photograph, its largest 1; equal numbers where nothing tells."""
    found = light_colour(one.scene, one.separation, one.image.metadata)
    return np.ones(3) if found is None else found


def neutralised(report: MaterialReport, values: Floats) -> Floats:
    """Reflectances (..., 3) of a relative scale without the light's colour; those of an absolute one as they are."""
    light = light_of(report)
    return values if report.scale == "absolute" else np.asarray(values * (light[1] / light))


def srgb_of(report: MaterialReport, fit: Fit, parameter: Estimate) -> Srgb | None:
    """A parameter that is a reflectance, in sRGB with its sd by the draws; None for others and unknown cameras."""
    if report.colour is None or parameter.name not in REFLECTANCES or parameter.estimate is None:
        return None
    from toolkit.radiometry.colour import to_xyz

    from .export.colour import srgb_hex

    mean, draws = np.broadcast_to(np.asarray(parameter.estimate, float), (3,)), fit.draws.get(parameter.name)
    if not np.isfinite(mean).all():
        return None
    balanced = neutralised(report, mean)
    spread = np.full(3, np.nan)
    if draws is not None and np.shape(draws)[-1:] == (3,):
        spread = (report.colour.to_srgb @ neutralised(report, np.reshape(draws, (-1, 3))).T).std(axis=1, ddof=1)
    linear = report.colour.to_srgb @ balanced
    shown = None if parameter.unit == "relative" else srgb_hex(linear)
    return Srgb(estimate=linear, sd=spread, xyz=to_xyz(report.colour) @ balanced, hex=shown)
