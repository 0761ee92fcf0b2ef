"""Scenes for renders, and the scene file that belongs to a photograph of one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from toolkit.geometry.lights import DirectionalLight
from toolkit.records import Camera, Light, Noise, Scene, Sphere

from .lights import across, movable, moved, scaled, vector


def direction(off_axis_deg: float, around_deg: float = 0.0) -> tuple[float, float, float]:
    """Unit vector `off_axis_deg` away from the camera's axis, turned by `around_deg` from right towards up."""
    off, around = np.radians([off_axis_deg, around_deg])
    x, y, z = np.sin(off) * np.cos(around), np.sin(off) * np.sin(around), np.cos(off)
    return float(x), float(y), float(z)


def sphere_in(
    width_px: int,
    height_px: int,
    *,
    radius_px: float,
    lights: Sequence[Light] = (DirectionalLight(direction=direction(30.0), irradiance=(1.0, 1.0, 1.0)),),
    offset_px: tuple[float, float] = (0.0, 0.0),
    focal_length_px: float | None = None,
    centre_sd_px: float = 0.1,
    radius_sd_px: float = 0.1,
) -> Scene:
    """A sphere in the frame's middle but for `offset_px`; orthographic unless a focal length is given."""
    middle = ((width_px - 1) / 2, (height_px - 1) / 2)
    camera = Camera()
    if focal_length_px is not None:
        camera = Camera(projection="perspective", focal_length_px=focal_length_px, principal_point_px=middle)
    sphere = Sphere(
        centre_px=(middle[0] + offset_px[0], middle[1] + offset_px[1]),
        radius_px=radius_px,
        covariance_px2=np.diag(np.square([centre_sd_px, centre_sd_px, radius_sd_px])),
        source="given",
    )
    known = any(light.irradiance is not None for light in lights)
    return Scene(camera=camera, sphere=sphere, lights=tuple(lights), scale="absolute" if known else "relative")


def exposed(scene: Scene, exposure: float) -> Scene:
    """The scene as a photograph's own units see it: every irradiance times `exposure`, and known."""
    lights = tuple(scaled(light, exposure) for light in scene.lights)
    return Scene(camera=scene.camera, sphere=scene.sphere, lights=lights, scale="absolute")


def as_measured(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene as someone measured it: sphere, light directions and irradiances off by draws from their stated sds.

    Fits of a render of `scene` must be given this one wherever intervals are to be tested.
    """
    x, y, radius = rng.multivariate_normal(
        [*scene.sphere.centre_px, scene.sphere.radius_px], scene.sphere.covariance_px2
    )
    sphere = Sphere(
        centre_px=(float(x), float(y)),
        radius_px=float(radius),
        covariance_px2=scene.sphere.covariance_px2.copy(),
        source=scene.sphere.source,
    )
    lights = tuple(_metered(_turned(light, rng), rng) for light in scene.lights)
    return Scene(camera=scene.camera, sphere=sphere, lights=lights, light_source=scene.light_source, scale=scene.scale)


def _turned(light: Light, rng: np.random.Generator) -> Light:
    """The light seen off by its `direction_sd_deg` in each of the two directions across."""
    towards = vector(light)
    distance = float(np.linalg.norm(towards))
    shift = np.tan(np.radians(movable(light).direction_sd_deg or 0.0)) * rng.standard_normal(2) @ across(towards)
    turned = towards / distance + shift
    return moved(light, distance * turned / np.linalg.norm(turned))


def _metered(light: Light, rng: np.random.Generator) -> Light:
    """The light with its irradiance off by its `irradiance_relative_sd`, each channel by itself."""
    sd = getattr(light, "irradiance_relative_sd", None)
    if not sd or light.irradiance is None:
        return light
    told = np.array(light.irradiance) * np.exp(sd * rng.standard_normal(3))
    return movable(light).model_copy(update={"irradiance": tuple(told.tolist())})


def scene_tables(scene: Scene, noise: Noise | None = None, *, irradiance: bool = True) -> dict[str, Any]:
    """The scene file's tables; without `irradiance` the scale is left unknown."""
    camera, sphere = scene.camera, scene.sphere
    sds = np.sqrt(np.diag(sphere.covariance_px2))
    tables: dict[str, Any] = {"camera": {"projection": camera.projection}}
    if camera.projection == "perspective":
        tables["camera"]["focal_length_px"] = camera.focal_length_px
        if camera.principal_point_px is not None:
            tables["camera"]["principal_point_px"] = list(camera.principal_point_px)
    tables["sphere"] = {
        "centre_px": list(sphere.centre_px),
        "radius_px": sphere.radius_px,
        "centre_sd_px": round(float(np.hypot(sds[0], sds[1]) / np.sqrt(2.0)), 12),
        "radius_sd_px": float(sds[2]),
    }
    unsaid = None if irradiance else {"irradiance", "irradiance_relative_sd"}
    tables["light"] = [
        movable(light).model_dump(mode="json", exclude_none=True, exclude=unsaid) for light in scene.lights
    ]
    if noise is not None:
        tables["noise"] = {"gain": noise.gain.tolist(), "read": noise.read.tolist()}
    return tables


def write_scene_toml(
    path: Path, scene: Scene, noise: Noise | None = None, *, irradiance: bool = True, comment: str = ""
) -> None:
    """Write the scene file of a photograph, with a comment of one or more lines above it."""
    import tomli_w

    head = "".join(f"# {line}\n" for line in comment.splitlines())
    path.write_text(head + tomli_w.dumps(scene_tables(scene, noise, irradiance=irradiance)), encoding="utf-8")
