"""A card of known reflectance turns the relative scale into an absolute one: the light's irradiance, and its error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from toolkit.errors import BadInputError, FitMaterialError
from toolkit.geometry.lights import AnyLight
from toolkit.radiometry.card import Card, exposure_ratio, measure_card
from toolkit.records import Floats, LinearImage, RawFrame, Reference, Scene

from .files import card_file
from .settings import ReferenceTable, Settings

LEAST_COSINE = 0.1  # of the angle between the card's normal and the light


def lit_by_reference(
    scene: Scene, image: LinearImage, frame: RawFrame, settings: Settings, folder: Path
) -> tuple[Scene, Reference | None]:
    """The scene with its lights' irradiance, and how it was found; as it is where no card is told of.

    `folder` is where a card's own photograph is looked for. Raises BadInputError for a card that cannot be used.
    """
    table, own = settings.reference, card_file(settings, folder)
    if table is None:
        return scene, None
    if any(light.irradiance is not None for light in scene.lights):
        raise BadInputError("both light.irradiance and reference tell the scale; leave one of them out")
    if own is None:
        _refuse_the_ball(scene, table)
        return _lit(scene, table, _card_of(frame, image, table, settings))
    exposed = _read_card(own, frame)
    card, ratio, ratio_sd = _own_exposure(exposed, image, table, settings)
    return _lit(scene, table, card, ratio, ratio_sd, sha256=exposed.sha256)


def _lit(
    scene: Scene,
    table: ReferenceTable,
    card: Card,
    ratio: float = 1.0,
    ratio_sd: float = 0.0,
    *,
    sha256: str | None = None,
) -> tuple[Scene, Reference]:
    """Every light times what one of irradiance 1 would have to be multiplied by to show the card as it is."""
    grey = np.array(table.grey)
    unit, cosine_sd = _unit_light(scene, table)
    factor = np.pi * ratio * card.radiance / (grey * unit)
    together = table.relative_sd**2 + cosine_sd**2 + ratio_sd**2
    covariance = np.diag(card.relative_sd**2) + together
    lights = tuple(_scaled(light, factor) for light in scene.lights)
    found = Reference(
        grey=grey,
        box_px=table.box_px,
        file=table.file,
        sha256=sha256,
        normal=table.normal,
        radiance=ratio * card.radiance,
        irradiance=factor,
        irradiance_sd=factor * np.sqrt(np.diag(covariance)),
    )
    return replace(scene, lights=lights, scale="absolute", irradiance_covariance=covariance), found


def _scaled(light: object, factor: Floats) -> AnyLight:
    irradiance = tuple(float(value) for value in factor)
    return light.model_copy(update={"irradiance": irradiance})  # type: ignore[attr-defined, no-any-return]  # every kind is a pydantic model


def _unit_light(scene: Scene, table: ReferenceTable) -> tuple[Floats, float]:
    """Irradiance (3,) on the card of lights of irradiance 1, and its relative sd by the directions' errors.

    The card stands where the box shows it, as far from the camera as the ball, or in its own photograph in the ball's
    place.
    """
    normal = np.array(table.normal) / np.linalg.norm(table.normal)
    place = np.zeros((1, 3))
    if table.file is None:
        (x, y), (left, top, width, height) = scene.sphere.centre_px, table.box_px
        away = np.array([left + (width - 1) / 2 - x, y - top - (height - 1) / 2]) / scene.sphere.radius_px
        place[0, :2] = away
    total, slope = np.zeros(3), 0.0
    for light in scene.lights:
        direction, irradiance = light.at(place)
        cosine = float(direction[0] @ normal)
        total += irradiance[0] * max(cosine, 0.0)
        tilt_sd = np.radians(np.hypot(table.normal_sd_deg, getattr(light, "direction_sd_deg", None) or 0.0))
        slope += float(irradiance[0].mean()) * np.sqrt(max(1.0 - cosine**2, 0.0)) * tilt_sd
    if total.min() < LEAST_COSINE * len(scene.lights):
        raise BadInputError(
            f"the reference card is turned away from the light (cosine {total.min():.2f}); expected it facing the "
            "light: give its normal, reference.normal"
        )
    return total, slope / float(total.mean())


def _refuse_the_ball(scene: Scene, table: ReferenceTable) -> None:
    (cx, cy), (x, y, width, height) = scene.sphere.centre_px, table.box_px
    nearest = np.clip(cx, x, x + width - 1) - cx, np.clip(cy, y, y + height - 1) - cy
    if np.hypot(*nearest) < scene.sphere.radius_px:
        raise BadInputError(f"the reference card's box {list(table.box_px)} lies on the sphere; expected it beside")


def _card_of(frame: RawFrame, image: LinearImage | None, table: ReferenceTable, settings: Settings) -> Card:
    """The card in a frame; its noise is the ball's `image`'s, or its own exposure's."""
    from toolkit.radiometry.linearise import linearise
    from toolkit.radiometry.quads import quads

    height, width = frame.values.shape[:2]
    x, y, across, down = table.box_px
    if x < 0 or y < 0 or x + across > width or y + down > height:
        raise BadInputError(
            f"the reference card's box {list(table.box_px)} leaves the {width} x {height} frame; expected x, y, "
            "width, height in pixels within it"
        )
    part = linearise(
        frame, box=(x, y, x + across, y + down), transfer=settings.image.transfer, noise=image.noise if image else None
    )
    return measure_card(quads(part), table.box_px, part.noise)


def _read_card(path: Path, frame: RawFrame) -> RawFrame:
    """The card's own photograph, of the kind that the ball's is."""
    from toolkit.io.read import read

    if not path.is_file():
        raise BadInputError(f"reference.file {path} does not exist; expected a photograph of the card")
    own = read(path)
    if own.format != frame.format:
        raise BadInputError(f"{own.name} is a {own.format} file, {frame.name} a {frame.format} one; expected one kind")
    return own


def _own_exposure(
    own: RawFrame, image: LinearImage, table: ReferenceTable, settings: Settings
) -> tuple[Card, float, float]:
    """The card in a photograph of its own, in the ball's place: its radiance, and the factor to the ball's exposure."""
    try:
        ratio, ratio_sd = exposure_ratio(image.metadata, own.metadata)
        return _card_of(own, None, table, settings), ratio, ratio_sd
    except FitMaterialError as error:
        raise BadInputError(f"{own.name}: {error}") from error
