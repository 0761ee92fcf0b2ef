"""One photograph examined, read this first: what a fit would read, find and stop at, and what it would wish for.

file -> RawFrame -> LinearImage and Scene, by the very stages of a fit -> Exposure, Surroundings, Lamp -> Advice.
Where a stage fails, what stands before it is still told.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipelines.locate import detected, light_seen, locate
from pipelines.settings import Settings, camera_of, noise_of_settings, sphere_of
from toolkit.errors import BadInputError, FitMaterialError
from toolkit.geometry.sphere import bounding_box
from toolkit.records import Camera, Floats, LinearImage, RawFrame, Scene, Sphere

from .advice import advice_for
from .exposure import exposure_of
from .records import Examination
from .samples import ball_of, thinned

if TYPE_CHECKING:
    from toolkit.geometry.highlight import LightFound
    from toolkit.geometry.lights import AnyLight


def examine(path: Path, settings: Settings) -> Examination:
    """Everything that can be told of a photograph; raises BadInputError where it cannot be read at all."""
    from toolkit.io.read import read

    frame = read(path)
    error: FitMaterialError | None = None
    image: LinearImage | None = None
    scene: Scene | None = None
    flags: tuple[str, ...] = ()
    try:
        image, scene, _, flags = locate(frame, settings, path.parent)
    except FitMaterialError as stopped:
        error = stopped
        image, scene = _what_there_is(frame, settings)
    return _with_advice(_examined(frame, settings, image, scene, flags, error))


def _what_there_is(frame: RawFrame, settings: Settings) -> tuple[LinearImage | None, Scene | None]:
    """The measurements and the ball as far as they go, where a fit would stop."""
    try:
        whole = _linear(frame, settings)
    except FitMaterialError:
        return None, None
    try:
        camera, sphere = _ball(frame, whole, settings)
        scene = Scene(camera=camera, sphere=sphere, lights=settings.light)
        return _linear(frame, settings, bounding_box(scene, whole.width_px, whole.height_px)), scene
    except FitMaterialError:
        return whole, None


def _ball(frame: RawFrame, whole: LinearImage, settings: Settings) -> tuple[Camera, Sphere]:
    camera = camera_of(settings, width_px=whole.width_px, height_px=whole.height_px, metadata=frame.metadata)
    sphere = sphere_of(settings)
    return camera, detected(whole, camera, settings.image.pick_px)[0] if sphere is None else sphere


def _linear(frame: RawFrame, settings: Settings, box: tuple[int, int, int, int] | None = None) -> LinearImage:
    from toolkit.radiometry.linearise import linearise

    return linearise(frame, box=box, transfer=settings.image.transfer, noise=noise_of_settings(settings))


def _examined(
    frame: RawFrame,
    settings: Settings,
    image: LinearImage | None,
    scene: Scene | None,
    flags: tuple[str, ...],
    error: FitMaterialError | None,
) -> Examination:
    from toolkit.radiometry.quads import quads

    from .lamp import lamp_of
    from .surroundings import surroundings_of

    ball = None if image is None or scene is None else ball_of(image, scene)
    ball = None if ball is None or not len(ball.x) else ball
    exposure = None if image is None else exposure_of(image, scene if ball is not None else None, ball)
    around, lamp = None, None
    if image is not None and scene is not None and ball is not None and exposure is not None:
        whole = quads(_linear(frame, settings))
        height, width = frame.values.shape[:2]
        around = surroundings_of(whole, scene, ball, exposure, (height, width))
        if scene.lights:
            own = _own_light(image, scene) if scene.light_source == "given" else None  # an estimated one is its own
            lamp = lamp_of(scene, ball, own, sd_deg=_sd_deg(scene))
    return Examination(
        frame=frame,
        image=image,
        scene=scene if ball is not None else None,
        noise_sd=_noise_sd(image),
        exposure=exposure,
        surroundings=around,
        lamp=lamp,
        flags=flags,
        advice=(),
        error=error,
    )


def _own_light(image: LinearImage, scene: Scene) -> LightFound | None:
    """What the ball's shading and highlight tell of the lamp, to hold against what was given; None where nothing."""
    from toolkit.radiometry.quads import quads

    try:
        return light_seen(thinned(quads(image), scene), scene)
    except BadInputError:
        return None


def _with_advice(found: Examination) -> Examination:
    return replace(found, advice=advice_for(found))


def _sd_deg(scene: Scene) -> float | None:
    first: AnyLight = scene.lights[0]  # type: ignore[assignment]  # every light of a scene is one of the kinds
    return first.direction_sd_deg


def _noise_sd(image: LinearImage | None) -> tuple[Floats, Floats] | None:
    """Standard errors of an estimated gain and read noise."""
    if image is None or image.noise.source != "estimated":
        return None
    from toolkit.radiometry.noise_estimate import estimate

    found = estimate(image.planes)
    usable = np.isfinite(found.gain_sd).all() and np.isfinite(found.read_sd).all()
    return (found.gain_sd, found.read_sd) if usable else None
