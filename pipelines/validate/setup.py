"""A user's own set-up, rendered again and again before the photograph is taken: how well will it tell?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipelines.layers import Layer, settings_of
from pipelines.settings import Settings, camera_of, lights_of, model_and_variant, noise_of_settings, sphere_of
from synthetic import camera as cam
from synthetic.materials import material
from synthetic.render import render
from synthetic.scenes import as_measured
from toolkit.errors import BadInputError
from toolkit.records import Scene

from .design import Trial
from .shot import Shot


def repeated(settings: Settings, count: int, *, seed: int = 0) -> tuple[Trial, ...]:
    """`count` photographs of one set-up, each with its own noise and its own error of the calibration.

    Raises BadInputError where the scene file lacks what a render needs.
    """
    _refuse_incomplete(settings)
    made_of, tables = settings.material, settings.model_dump(mode="json", exclude_none=True)
    if made_of is None:  # refused above; for the type checker
        raise BadInputError("the scene lacks [material]; expected what the ball may be made of")
    return tuple(
        Trial(
            number=i,
            seed=seed * 1_000_003 + i,
            model=made_of.model,
            diffuse=made_of.diffuse,
            parameters=made_of.parameters,
            scene={},
            setup=tables,
        )
        for i in range(count)
    )


def shoot_setup(trial: Trial, tables: Mapping[str, Any]) -> Shot:
    """The set-up's ball, rendered; what its user is told of it is off by its own stated errors."""
    settings = settings_of([Layer(name="the set-up", values=tables)])
    image, sphere = settings.image, sphere_of(settings)
    if sphere is None or image.width_px is None or image.height_px is None:
        raise BadInputError("the scene lacks [sphere] or the image's size; expected what a render needs")
    lights = lights_of(settings)
    scene = Scene(
        camera=camera_of(settings, width_px=image.width_px, height_px=image.height_px),
        sphere=sphere,
        lights=lights,
        scale="absolute" if all(light.irradiance for light in lights) else "relative",
    )
    model, variant = model_and_variant(trial.model)
    made_of = material(model, trial.parameters, diffuse=trial.diffuse, variant=variant)
    background, pedestal = np.array(image.background), np.array(image.pedestal)
    picture = render(
        scene, made_of, width_px=image.width_px, height_px=image.height_px, background=background, pedestal=pedestal
    )
    if image.blur_sd_px > 0.0:
        picture = cam.blurred(picture, sd_px=image.blur_sd_px)
    told = as_measured(with_default_errors(scene), np.random.default_rng([trial.seed, 1]))
    return Shot(
        scene=scene,
        told=told,
        material=made_of,
        noise=noise_of_settings(settings) or cam.GOOD_CAMERA,
        picture=picture,
        exposure=image.exposure or cam.exposure_for(picture, highlight=0.8),
        seed=trial.seed,
    )


def with_default_errors(scene: Scene) -> Scene:
    """The scene with the errors that a fit would assume of lights whose file states none."""
    from toolkit.inference.gather import DIRECTION_SD_DEG

    stated = tuple(
        light if light.direction_sd_deg is not None else light.model_copy(update={"direction_sd_deg": DIRECTION_SD_DEG})  # type: ignore[attr-defined]  # every kind of the scene file has it
        for light in scene.lights
    )
    return replace(scene, lights=stated)


def _refuse_incomplete(settings: Settings) -> None:
    there = {
        "[material]": settings.material,
        "[sphere]": settings.sphere,
        "[[light]]": settings.light,
        "image.width_px": settings.image.width_px,
        "image.height_px": settings.image.height_px,
    }
    lacking = ", ".join(name for name, value in there.items() if not value)
    if lacking:
        raise BadInputError(f"the scene lacks {lacking}; expected what a render of the set-up needs")
    if any(getattr(light, "returned_sd", None) for light in lights_of(settings)):
        raise BadInputError("light.returned_sd: nothing around a rendered ball sends light back; leave it out")
