"""A rendered ball and its photographs, for the tests of the inference."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from synthetic.camera import exposure_for
from synthetic.materials import Material, material
from synthetic.render import render
from synthetic.scenes import direction, exposed
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.records import Camera, Floats, LinearImage, Noise, Plane, Scene, Sphere

NOISE = Noise(gain=np.full(3, 1 / 40000), read=np.full(3, 3 / 40000), source="given")
BODY, F0 = (0.45, 0.2, 0.08), 0.04
EXIF = {  # what a DNG must say and no fit here looks at
    "xyz_to_camera": np.eye(3),
    "as_shot_neutral": (1.0, 1.0, 1.0),
    "exposure_s": 1 / 60,
    "iso": 100,
    "f_number": 16.0,
    "focal_length_mm": 85.0,
}


def scene_of(size_px: int, *, light_deg: float = 35.0, sphere_sd_px: float = 0.1, scale: str = "absolute") -> Scene:
    """A ball of 0.42 of the frame, a little off its middle, under one far light."""
    light = DirectionalLight(direction=direction(light_deg, 20.0), irradiance=(3.0, 3.0, 3.0))
    sphere = Sphere(
        centre_px=(0.5 * size_px + 3.3, 0.5 * size_px - 1.8),
        radius_px=0.42 * size_px,
        covariance_px2=np.eye(3) * sphere_sd_px**2,
        source="given",
    )
    return Scene(
        camera=Camera(), sphere=sphere, lights=(light,), scale="absolute" if scale == "absolute" else "relative"
    )


def glossy(model: str = "torrance-sparrow", **shape: float) -> Material:
    """A body of clear hue under a dielectric coat of index 1.5."""
    numbers = shape or {"roughness_rad": 0.12}
    colour = {"specular_albedo": 0.1} if model in ("phong", "blinn-phong") else {"specular_f0": F0}
    return material(model, {**numbers, "diffuse_albedo": BODY, **colour})


@cache
def _rendered(size_px: int, model: str, shape: tuple[tuple[str, float], ...], light_deg: float) -> tuple[Floats, Scene]:
    scene = scene_of(size_px, light_deg=light_deg)
    picture = render(scene, glossy(model, **dict(shape)), width_px=size_px, height_px=size_px, supersample=8)
    factor = exposure_for(picture, highlight=0.8)
    return picture.radiance() * factor, exposed(scene, factor)


def radiance_of(
    size_px: int, model: str = "torrance-sparrow", *, light_deg: float = 35.0, **shape: float
) -> tuple[Floats, Scene]:
    """Radiance (h, w, 3) with the highlight at 0.8 of saturation, and the scene with its irradiance."""
    return _rendered(size_px, model, tuple(sorted((shape or {"roughness_rad": 0.12}).items())), light_deg)


def replace_light(scene: Scene, **changes: object) -> Scene:
    """The scene with its first light told otherwise."""
    light = scene.lights[0]
    assert isinstance(light, DirectionalLight | PointLight)
    return replace(scene, lights=(light.model_copy(update=changes), *scene.lights[1:]))


def photograph(radiance: Floats, *, seed: int, noise: Noise = NOISE, mosaic: bool = True) -> LinearImage:
    """A photograph of the radiance with shot and read noise, as a Bayer mosaic or as three planes."""
    rng = np.random.default_rng(seed)
    signal = radiance + rng.standard_normal(radiance.shape) * np.sqrt(
        noise.gain * np.maximum(radiance, 0.0) + noise.read**2
    )
    places = ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)) if mosaic else ((0, 0, 0), (0, 0, 1), (0, 0, 2))
    step = 2 if mosaic else 1
    planes = []
    for row, column, channel in places:
        values = np.ascontiguousarray(signal[row::step, column::step, channel], np.float32)
        flags = np.zeros(values.shape, np.uint8)
        planes.append(
            Plane(channel=channel, values=values, flags=flags, origin_px=(float(column), float(row)), step_px=step)
        )
    return LinearImage(
        name="ball",
        sha256="",
        width_px=radiance.shape[1],
        height_px=radiance.shape[0],
        planes=tuple(planes),
        noise=noise,
        white=1.0,
    )
