"""From a sphere's surface to pixel coordinates: where a point, the outline and a lamp's mirror image appear."""

from __future__ import annotations

import numpy as np

from toolkit.records import Camera, Floats, Light, Sphere

from .sphere import centre_position

_ROUNDS = 30  # each takes the view's error down by at least the ratio of radius to distance


def project(camera: Camera, sphere: Sphere, points: Floats) -> Floats:
    """Pixel coordinates (N, 2) of `points` (N, 3), in sphere radii from the sphere's centre, camera frame."""
    points = np.asarray(points, float)
    if camera.focal_length_px is None or camera.principal_point_px is None:
        return np.asarray(np.asarray(sphere.centre_px) + sphere.radius_px * points[..., :2] * (1.0, -1.0))
    there = points + centre_position(camera, sphere)
    scale = camera.focal_length_px / -there[..., 2:]
    return np.asarray(np.asarray(camera.principal_point_px) + scale * there[..., :2] * (1.0, -1.0))


def limb_px(camera: Camera, sphere: Sphere, *, count: int = 360) -> Floats:
    """The outline as pixel coordinates (count, 2): a circle, in perspective an ellipse."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    towards, height = np.array([0.0, 0.0, 1.0]), 0.0
    if camera.projection == "perspective":
        centre = centre_position(camera, sphere)
        distance = float(np.linalg.norm(centre))
        towards, height = -centre / distance, 1.0 / distance
    a = np.cross(towards, np.eye(3)[int(np.argmin(np.abs(towards)))])
    a /= np.linalg.norm(a)
    ring = np.cos(turn)[:, None] * a + np.sin(turn)[:, None] * np.cross(towards, a)
    return project(camera, sphere, height * towards + np.sqrt(1.0 - height**2) * ring)


def mirror_place(camera: Camera, sphere: Sphere, light: Light) -> Floats | None:
    """The normal (3,) of the place where a mirror would show the light; None where that place is not in view."""
    centre = centre_position(camera, sphere) if camera.projection == "perspective" else None
    normal = np.array([0.0, 0.0, 1.0])
    for _ in range(_ROUNDS):
        view = _view(centre, normal)
        half = light.at(normal[None])[0][0] + view
        length = float(np.linalg.norm(half))
        if length < 1e-6:
            return None
        normal = half / length
    return normal if float(normal @ _view(centre, normal)) > 0.0 else None


def _view(centre: Floats | None, point: Floats) -> Floats:
    if centre is None:
        return np.array([0.0, 0.0, 1.0])
    there = -(centre + point)
    return np.asarray(there / np.linalg.norm(there))
