"""From pixel coordinates to a sphere's surface: position, normal and view direction of each sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, Scene, Sphere, readonly

from .repeated import repeated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """Surface points under samples; off the sphere `on_sphere` is False and the vectors are of the nearest limb.

    `offset2` is the square of how far from the centre each line of sight passes, in sphere radii: on the sphere
    n.v = sqrt(1 - offset2). Over a pixel that distance changes by at most 1 / (radius_px cos(angular radius)).
    """

    normal: Floats  # (N, 3) unit; also the position in sphere radii from the centre
    view: Floats  # (N, 3) unit, towards the camera
    offset2: Floats  # (N,)

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def on_sphere(self) -> NDArray[np.bool_]:
        """Which lines of sight meet the sphere (N,)."""
        return np.asarray(self.offset2 < 1.0)

    def thinned(self, every: int) -> Surface:
        """At one place in so many along the last axis, these together in memory, each component as before."""

        def few(vectors: Floats) -> Floats:
            some = vectors[..., ::every, :]
            return some.copy(order="K") if any(some.strides[:-1]) else some

        return Surface(
            normal=few(self.normal), view=few(self.view), offset2=np.ascontiguousarray(self.offset2[..., ::every])
        )


def surface(
    camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats, *, dtype: type[np.floating[Any]] = np.float64
) -> Surface:
    """The surface points seen at pixel coordinates, arrays that broadcast; worked out in float64, told in `dtype`."""
    x, y = np.asarray(x_px, float), np.asarray(y_px, float)
    if camera.projection == "orthographic":
        return _orthographic(sphere, x, y, dtype)
    return _perspective(camera, sphere, x, y, dtype)


def on_sphere(camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats) -> NDArray[np.bool_]:
    """Which pixel coordinates, arrays that broadcast, see the sphere: what `surface` says, without the vectors."""
    if camera.projection == "perspective":
        return np.asarray(_sight(camera, sphere, x_px, y_px)[-1] < 1.0)
    across, down = (x_px - sphere.centre_px[0]) / sphere.radius_px, (y_px - sphere.centre_px[1]) / sphere.radius_px
    return np.asarray(across**2 < 1.0 - down**2)  # truth values at once: their sum would be a picture of its own


def _orthographic(sphere: Sphere, x: Floats, y: Floats, dtype: type[np.floating[Any]]) -> Surface:
    right, up = (x - sphere.centre_px[0]) / sphere.radius_px, (sphere.centre_px[1] - y) / sphere.radius_px
    offset2 = right * right + up * up
    normal = np.empty((3, *offset2.shape), dtype)  # each component together in memory: what follows takes them apart
    normal[0], normal[1], normal[2] = right, up, 1.0 - offset2
    if normal[2].min(initial=1.0) <= 0.0:
        normal[:2] /= np.sqrt(np.maximum(offset2, 1.0))
        np.maximum(normal[2], 0.0, out=normal[2])
    np.sqrt(normal[2], out=normal[2])
    vectors = normal.transpose(*range(1, normal.ndim), 0)
    return Surface(normal=vectors, view=repeated((0.0, 0.0, 1.0), vectors.shape, dtype), offset2=offset2)


def _perspective(camera: Camera, sphere: Sphere, x: Floats, y: Floats, dtype: type[np.floating[Any]]) -> Surface:
    rays, along, offset2 = _sight(camera, sphere, x, y)
    along = along - np.sqrt(np.maximum(1.0 - offset2, 0.0))
    points = [along * ray - c for ray, c in zip(rays, centre_position(camera, sphere), strict=True)]
    length = _length(points)
    return Surface(
        normal=_vectors([part / length for part in points], dtype),
        view=_vectors([-ray for ray in rays], dtype),
        offset2=offset2,
    )


def _sight(camera: Camera, sphere: Sphere, x: Floats, y: Floats) -> tuple[list[Floats], Floats, Floats]:
    """Components of unit vectors from the camera, how far along them the sphere's centre lies, and `offset2`."""
    rays, centre = _rays(camera, x, y), centre_position(camera, sphere)
    along = np.stack(rays, axis=-1) @ centre
    return rays, along, centre @ centre - along * along


def _vectors(parts: list[Floats], dtype: type[np.floating[Any]]) -> Floats:
    """Vectors (..., 3) of their components.

    A picture's keep each component together in memory; a fit's lie one by one, by which its products of matrices round.
    """
    return np.stack(parts, axis=-1) if dtype is np.float64 else np.moveaxis(np.array(parts, dtype), 0, -1)


def _length(parts: list[Floats]) -> Floats:
    return np.asarray(np.sqrt(parts[0] * parts[0] + parts[1] * parts[1] + parts[2] * parts[2]))


def _rays(camera: Camera, x: Floats, y: Floats) -> list[Floats]:
    if camera.focal_length_px is None or camera.principal_point_px is None:
        raise ValueError("a perspective camera needs focal_length_px and principal_point_px")
    px, py = camera.principal_point_px
    f = camera.focal_length_px
    rays = [(x - px) / f, -(y - py) / f, np.array(-1.0)]
    length = _length(rays)
    return [ray / length for ray in rays]


def centre_position(camera: Camera, sphere: Sphere) -> Floats:
    """The sphere's centre (3,) in sphere radii from the camera, camera frame; perspective only."""
    towards = np.array(_rays(camera, np.array(sphere.centre_px[0]), np.array(sphere.centre_px[1])))
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
