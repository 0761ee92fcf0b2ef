"""Spheres rendered by Mitsuba 3: an independent renderer with its own lobes, cameras and lights.

The material is a `blendbsdf` of `diffuse` and `roughconductor`: `weight` of a metal that mirrors everything
(F = 1), the rest Lambert, so albedo and specular strength are known exactly. What Mitsuba evaluates for it is
F D G / (4 n.v) with the separable Smith G; for Beckmann G1 is Walter's rational fit, for GGX the exact one.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from synthetic.materials import Material, material
from synthetic.scenes import direction
from toolkit.geometry.lights import AnyLight, DirectionalLight, PointLight
from toolkit.records import Camera, Floats, Scene, Sphere

LLVM = (
    "/usr/lib/x86_64-linux-gnu/libLLVM-19.so",
    "/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1",
    "/usr/lib/llvm-19/lib/libLLVM.so.1",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ball:
    """A glossy ball under one light; lengths in its own radii."""

    distribution: Literal["beckmann", "ggx"] = "beckmann"
    alpha: float = 0.15
    albedo: tuple[float, float, float] = (0.6, 0.3, 0.15)  # of the Lambert part, before the blend
    weight: float = 0.2  # of the mirroring metal
    projection: Literal["orthographic", "perspective"] = "orthographic"
    light: Literal["directional", "point"] = "directional"
    light_off_axis_deg: float = 35.0
    light_around_deg: float = 130.0
    light_distance: float = 8.0
    irradiance: tuple[float, float, float] = (2.0, 1.6, 1.2)
    size_px: int = 300
    radius_px: float = 125.0  # orthographic; perspective: of a sphere on the axis
    camera_distance: float = 10.0
    shift: tuple[float, float] = (0.07, -0.05)  # of the ball off the axis, right and up

    @property
    def truth(self) -> Material:
        """The material in this project's terms."""
        albedo = tuple((1.0 - self.weight) * a for a in self.albedo)
        numbers = {"alpha": self.alpha, "diffuse_albedo": albedo, "specular_strength": self.weight}
        return material(self.distribution, numbers, variant={"masking": "smith"})

    @property
    def scene(self) -> Scene:
        """Camera, sphere and light in this project's terms."""
        camera, centre, radius = Camera(), self._off_axis(self.radius_px), self.radius_px
        if self.projection == "perspective":
            middle = (self.size_px - 1) / 2
            camera = Camera(
                projection="perspective", focal_length_px=self._focal_px, principal_point_px=(middle, middle)
            )
            away = float(np.linalg.norm([*self.shift, self.camera_distance]))
            centre = self._off_axis(self._focal_px / self.camera_distance)
            radius = self._focal_px * float(np.tan(np.arcsin(1.0 / away)))
        sphere = Sphere(centre_px=centre, radius_px=radius, covariance_px2=np.eye(3) * 1e-6, source="given")
        return Scene(camera=camera, sphere=sphere, lights=(self._light,), scale="absolute")

    @property
    def _focal_px(self) -> float:
        return self.radius_px * self.camera_distance

    @property
    def _light(self) -> AnyLight:
        towards = direction(self.light_off_axis_deg, self.light_around_deg)
        if self.light == "directional":
            return DirectionalLight(direction=towards, irradiance=self.irradiance)
        x, y, z = (self.light_distance * v for v in towards)
        return PointLight(position=(x, y, z), irradiance=self.irradiance)

    def _off_axis(self, px_per_radius: float) -> tuple[float, float]:
        middle, (right, up) = (self.size_px - 1) / 2, self.shift
        return middle + right * px_per_radius, middle - up * px_per_radius


def render(ball: Ball, *, samples: int = 256, bsdf: Mapping[str, Any] | None = None) -> Floats:
    """Linear radiance (H, W, 3), box-filtered, of `samples` (a square) per pixel; `bsdf` in place of the ball's own.

    Skips the test where Mitsuba or LLVM is missing.
    """
    mitsuba = pytest.importorskip("mitsuba", reason="needs mitsuba, a package of the dev group")
    _find_llvm()
    mitsuba.set_variant("llvm_ad_rgb")
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
            "sensor": _sensor(mitsuba, ball, samples),
            "light": _light(ball),
            "ball": {"type": "sphere", "center": [*ball.shift, 0.0], "radius": 1.0, "bsdf": bsdf or _bsdf(ball)},
        }
    )
    return np.array(mitsuba.render(scene, seed=1), dtype=float)


def llvm() -> str | None:
    """The LLVM that Mitsuba can use, where there is one."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH", "")
    return next((path for path in (given, *LLVM) if path and Path(path).exists()), None)


def _find_llvm() -> None:
    found = llvm()
    if found is None:
        pytest.skip("needs LLVM 19 (Debian: libllvm19), or DRJIT_LIBLLVM_PATH")
    os.environ["DRJIT_LIBLLVM_PATH"] = found


def _bsdf(ball: Ball) -> dict[str, Any]:
    return {
        "type": "blendbsdf",
        "weight": ball.weight,
        "body": {"type": "diffuse", "reflectance": _rgb(ball.albedo)},
        "gloss": {
            "type": "roughconductor",
            "material": "none",
            "distribution": ball.distribution,
            "alpha": ball.alpha,
        },
    }


def _light(ball: Ball) -> dict[str, Any]:
    towards = direction(ball.light_off_axis_deg, ball.light_around_deg)
    if ball.light == "directional":
        return {
            "type": "directional",
            "direction": [-v for v in towards],
            "irradiance": _rgb(ball.irradiance),
        }
    place = [ball.light_distance * v + o for v, o in zip(towards, [*ball.shift, 0.0], strict=True)]
    return {
        "type": "point",
        "position": place,
        "intensity": _rgb(tuple(ball.light_distance**2 * e for e in ball.irradiance)),
    }


def _sensor(mitsuba: Any, ball: Ball, samples: int) -> dict[str, Any]:
    looking = mitsuba.ScalarTransform4f().look_at(origin=[0, 0, ball.camera_distance], target=[0, 0, 0], up=[0, 1, 0])
    half = 0.5 * ball.size_px / ball.radius_px
    shared = {
        "near_clip": 0.1,
        "far_clip": 1000.0,
        "film": {
            "type": "hdrfilm",
            "width": ball.size_px,
            "height": ball.size_px,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": samples},
    }
    if ball.projection == "orthographic":
        scale = mitsuba.ScalarTransform4f().scale([half, half, 1.0])
        return shared | {"type": "orthographic", "to_world": looking @ scale}
    fov = float(np.degrees(2.0 * np.arctan(half / ball.camera_distance)))
    return shared | {"type": "perspective", "fov": fov, "fov_axis": "x", "to_world": looking}


def _rgb(value: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}
