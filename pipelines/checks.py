"""Geometry that cannot be: told before anything is fitted."""

from __future__ import annotations

import numpy as np

from toolkit.errors import BadInputError
from toolkit.geometry.sphere import centre_position
from toolkit.records import Camera, Floats, Scene, Sphere

FEWEST_RADIUS_PX = 12.0
CUT_SHARE = 0.05  # of the radius: what may reach beyond the frame
BEHIND = -0.95  # cosine between light and line of sight below which at most 2.5 % of the disc, all limb, are lit


def check_sphere(sphere: Sphere, width_px: int, height_px: int) -> None:
    """Raise BadInputError for a sphere too small to measure, or not whole in the frame."""
    (x, y), radius = sphere.centre_px, sphere.radius_px
    if radius < FEWEST_RADIUS_PX:
        raise BadInputError(
            f"sphere.radius_px is {radius:.4g}; expected {FEWEST_RADIUS_PX:.0f} px or more: photograph it larger"
        )
    if min(x, y, width_px - 1 - x, height_px - 1 - y) < 0:
        raise BadInputError(
            f"the sphere's centre ({x:.6g}, {y:.6g}) lies outside the {width_px} x {height_px} frame; "
            "expected pixel coordinates, x right and y down from the first pixel"
        )
    beyond = {"left": radius - x, "top": radius - y}
    beyond |= {"right": x + radius - (width_px - 1), "bottom": y + radius - (height_px - 1)}
    edge = max(beyond, key=lambda name: beyond[name])
    if beyond[edge] > CUT_SHARE * radius:
        raise BadInputError(
            f"the frame cuts the sphere: it reaches {beyond[edge]:.5g} px beyond the {edge} edge; "
            "expected a whole ball: photograph it from further away, or correct --sphere"
        )


def check_lights(scene: Scene) -> None:
    """Raise BadInputError for a light that only reaches what the camera does not see."""
    towards_camera = _view(scene.camera, scene.sphere)
    for light in scene.lights:
        if float(np.dot(light.direction, towards_camera)) < BEHIND:
            raise BadInputError(
                f"the light {written(light.direction)} stands behind the sphere and lights its far side; "
                "expected a direction towards the light: x right, y up, z towards the camera"
            )


def _view(camera: Camera, sphere: Sphere) -> Floats:
    """From the sphere's centre towards the camera."""
    if camera.projection == "orthographic":
        return np.array([0.0, 0.0, 1.0])
    centre = centre_position(camera, sphere)
    return np.asarray(-centre / np.linalg.norm(centre))


def written(direction: tuple[float, ...]) -> str:
    """A direction as `--light` takes it."""
    return ",".join(f"{value:.2f}" for value in direction)
