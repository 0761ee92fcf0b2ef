"""Where the sphere and the lights are: what the settings say, else what the photograph shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from toolkit.flags import Flag
from toolkit.geometry.glare import without_glare
from toolkit.geometry.lights import DirectionalLight
from toolkit.geometry.sphere import bounding_box
from toolkit.records import Camera, LinearImage, RawFrame, Reference, Scene, Sphere

from .checks import check_lights, check_sphere
from .exposure import check_exposure, exposure_explains
from .reference import lit_by_reference
from .settings import Settings, camera_of, lights_of, noise_of_settings, sphere_of

if TYPE_CHECKING:
    from toolkit.geometry.highlight import LightFound
    from toolkit.radiometry.quads import Quads

SMOOTH_SHARE = 0.95  # of the radius: what lies within is the ball, smooth but for its noise
SHADED_SD_PX = 0.3  # between a ball's outline and the sphere that its shading shows, as on real photographs
ESTIMATED_LIGHT_SD_DEG = 3.0  # at least, of a light read off its own highlight


class Located(NamedTuple):
    """Where everything is, and what of it was estimated."""

    image: LinearImage  # the sphere's part of the photograph
    scene: Scene
    reference: Reference | None
    flags: tuple[str, ...]


def locate(frame: RawFrame, settings: Settings, folder: Path = Path()) -> Located:
    """The sphere's part of the photograph in linear units, and the scene.

    `folder` is where files that the settings name are looked for: the photograph's.
    """
    from toolkit.radiometry.linearise import linearise

    height, width = frame.values.shape[:2]
    camera = camera_of(settings, width_px=width, height_px=height, metadata=frame.metadata)
    sphere, flags = sphere_of(settings), list[str]()
    noise, transfer = noise_of_settings(settings), settings.image.transfer
    if sphere is None:
        whole = linearise(frame, transfer=transfer, noise=noise)
        with exposure_explains(whole):
            sphere, uncertain = detected(whole, camera, settings.image.pick_px)
        sphere = _as_shaded(sphere)
        flags += [Flag.SPHERE_UNCERTAIN] if uncertain else []
    check_sphere(sphere, width, height)
    lights = lights_of(settings)
    known = bool(lights) and all(light.irradiance for light in lights)
    scale: Literal["absolute", "relative"] = "absolute" if known else "relative"
    scene = Scene(camera=camera, sphere=sphere, lights=lights, scale=scale)
    check_lights(scene)
    image = linearise(
        frame, box=bounding_box(scene, width, height), transfer=transfer, noise=noise, disc=_smooth_disc(sphere)
    )
    check_exposure(image, scene)
    if not lights:
        scene = _estimate_light(image, scene)
        flags.append(Flag.LIGHT_ESTIMATED)
    image = without_glare(image, scene)
    scene, reference = lit_by_reference(scene, image, frame, settings, folder)
    return Located(image, scene, reference, tuple(flags))


def _as_shaded(sphere: Sphere) -> Sphere:
    """A detected sphere as a fit may trust it: an outline sharper than a real ball's shading is a sphere's."""
    more = SHADED_SD_PX**2 * np.eye(3)
    return replace(sphere, covariance_px2=np.asarray(sphere.covariance_px2) + more)


def _smooth_disc(sphere: Sphere) -> tuple[float, float, float]:
    """Within the outline, whatever its error and a perspective's bulge."""
    return *sphere.centre_px, SMOOTH_SHARE * sphere.radius_px


def detected(whole: LinearImage, camera: Camera, pick_px: tuple[float, float] | None) -> tuple[Sphere, bool]:
    """The largest ball of a whole photograph, or the one around `pick_px`, and whether its outline is uncertain.

    Raises BadInputError where there is none.
    """
    from toolkit.geometry.outline import find_sphere

    found = find_sphere(whole, camera=camera, pick=pick_px)
    return found.sphere, found.uncertain


def light_seen(picture: Quads, scene: Scene) -> LightFound:
    """The far light that the ball's own highlight tells of; raises BadInputError where it tells of none."""
    from toolkit.geometry.highlight import light_from_highlight

    return light_from_highlight(
        picture.values,
        sphere=scene.sphere,
        camera=scene.camera,
        origin_px=picture.origin_px,
        step_px=picture.step_px,
        flags=picture.flags,
    )


def _estimate_light(image: LinearImage, scene: Scene) -> Scene:
    from toolkit.radiometry.quads import quads

    found = light_seen(quads(image), scene)
    light = DirectionalLight(direction=found.direction, direction_sd_deg=max(found.sd_deg, ESTIMATED_LIGHT_SD_DEG))
    return Scene(camera=scene.camera, sphere=scene.sphere, lights=(light,), light_source="estimated", scale="relative")
