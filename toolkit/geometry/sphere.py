"""From pixel coordinates to a sphere's surface: position, normal and view direction of each sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, Scene, Sphere, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """Surface points under samples; off the sphere `on_sphere` is False and the vectors are of the nearest limb."""

    normal: Floats  # (N, 3) unit; also the position in sphere radii from the centre
    view: Floats  # (N, 3) unit, towards the camera
    on_sphere: NDArray[np.bool_]  # (N,)

    def __post_init__(self) -> None:
        readonly(self)

    def part(self, index: int | tuple[slice, ...]) -> Surface:
        """At some of the samples."""
        return Surface(normal=self.normal[index], view=self.view[index], on_sphere=self.on_sphere[index])


def surface(camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats) -> Surface:
    """The surface points seen at pixel coordinates (N,), in float64."""
    x, y = np.asarray(x_px, float), np.asarray(y_px, float)
    if camera.projection == "orthographic":
        return _orthographic(sphere, x, y)
    return _perspective(camera, sphere, x, y)


def on_sphere(camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats) -> NDArray[np.bool_]:
    """Which pixel coordinates, arrays that broadcast, see the sphere: what `surface` says, without the vectors."""
    if camera.projection == "perspective":
        x, y = np.broadcast_arrays(x_px, y_px)
        return surface(camera, sphere, x, y).on_sphere
    squared = ((x_px - sphere.centre_px[0]) / sphere.radius_px) ** 2
    return np.asarray(squared + ((y_px - sphere.centre_px[1]) / sphere.radius_px) ** 2 < 1.0)


def sight_offset(camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats) -> Floats:
    """How far from the sphere's centre each line of sight passes, in sphere radii: below 1 it meets the sphere.

    There n.v = sqrt(1 - offset^2). Over a pixel it changes by at most 1 / (radius_px cos(angular radius)).
    """
    if camera.projection == "orthographic":
        x, y = x_px - sphere.centre_px[0], y_px - sphere.centre_px[1]
        return np.asarray(np.sqrt(x * x + y * y) / sphere.radius_px)
    centre = centre_position(camera, sphere)
    along = _rays(camera, np.asarray(x_px, float), np.asarray(y_px, float)) @ centre
    return np.asarray(np.sqrt(np.maximum(centre @ centre - along * along, 0.0)))


def _orthographic(sphere: Sphere, x: Floats, y: Floats) -> Surface:
    nx = (x - sphere.centre_px[0]) / sphere.radius_px
    ny = -(y - sphere.centre_px[1]) / sphere.radius_px
    r2 = nx * nx + ny * ny
    on_sphere = r2 < 1.0
    if not on_sphere.all():
        shrink = 1.0 / np.sqrt(np.maximum(r2, 1.0))
        nx, ny = nx * shrink, ny * shrink
    normal = _vectors(nx, ny, np.sqrt(np.maximum(1.0 - r2, 0.0)))
    return Surface(normal=normal, view=np.broadcast_to((0.0, 0.0, 1.0), normal.shape), on_sphere=on_sphere)


def _vectors(x: Floats, y: Floats, z: Floats) -> Floats:
    """Vectors (..., 3) of three components, each of which lies together in memory: what follows takes them apart."""
    return np.moveaxis(np.stack([x, y, z]), 0, -1)


def _perspective(camera: Camera, sphere: Sphere, x: Floats, y: Floats) -> Surface:
    rays = _rays(camera, x, y)
    centre = centre_position(camera, sphere)
    along = rays @ centre
    discriminant = along * along - (centre @ centre - 1.0)
    points = (along - np.sqrt(np.maximum(discriminant, 0.0)))[..., None] * rays - centre
    normal = points / np.linalg.norm(points, axis=-1, keepdims=True)
    return Surface(normal=normal, view=-rays, on_sphere=discriminant > 0.0)


def _rays(camera: Camera, x: Floats, y: Floats) -> Floats:
    if camera.focal_length_px is None or camera.principal_point_px is None:
        raise ValueError("a perspective camera needs focal_length_px and principal_point_px")
    px, py = camera.principal_point_px
    f = camera.focal_length_px
    rays = np.stack([(x - px) / f, -(y - py) / f, np.full_like(x, -1.0)], axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def centre_position(camera: Camera, sphere: Sphere) -> Floats:
    """The sphere's centre (3,) in sphere radii from the camera, camera frame; perspective only."""
    towards = _rays(camera, np.array(sphere.centre_px[0]), np.array(sphere.centre_px[1]))
    if camera.focal_length_px is None:
        raise ValueError("a perspective camera needs focal_length_px")
    return np.asarray(towards / np.sin(np.arctan(sphere.radius_px / camera.focal_length_px)))


def bounding_box(scene: Scene, width_px: int, height_px: int) -> tuple[int, int, int, int]:
    """Pixel box (x0, y0, x1, y1), end exclusive, that holds the sphere's whole image inside the frame."""
    camera, sphere = scene.camera, scene.sphere
    cx, cy = sphere.centre_px
    grow = 1.0
    if camera.projection == "perspective" and camera.focal_length_px and camera.principal_point_px:
        # the outline is an ellipse: longer along the line to the principal point by up to 1 / cos^2 of the edge
        off = np.hypot(cx - camera.principal_point_px[0], cy - camera.principal_point_px[1]) + sphere.radius_px
        grow = 1.0 + (off / camera.focal_length_px) ** 2
    reach = sphere.radius_px * grow + 2.0
    x0, y0 = max(int(np.floor(cx - reach)), 0), max(int(np.floor(cy - reach)), 0)
    x1, y1 = min(int(np.ceil(cx + reach)) + 1, width_px), min(int(np.ceil(cy + reach)) + 1, height_px)
    return x0, y0, x1, y1
