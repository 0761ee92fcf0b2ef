"""The sphere's outline in the picture: a circle, or the ellipse that perspective makes of it.

Both are the set of view rays at the angular radius from the sphere's centre, so one signed distance serves both and
the geometric fit works in the Sphere record's own three numbers: no ellipse has to be converted afterwards.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.records import Camera, Floats

Distance = Callable[[Floats, Floats, Floats], Floats]


def depth_px(camera: Camera, shape: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """Distance inside the outline along its normal, px (negative outside), to first order around the outline.

    `shape` is (centre x, centre y, radius) as in `Sphere`; raises ValueError on a perspective camera without its
    focal length or principal point.
    """
    if camera.projection == "orthographic":
        return np.asarray(shape[2] - np.hypot(x_px - shape[0], y_px - shape[1]))
    f, px, py = lens(camera)
    ray = np.stack([(x_px - px) / f, (y_px - py) / f])
    centre = np.array([(shape[0] - px) / f, (shape[1] - py) / f])
    angle, slope = _angle_and_slope(ray, centre)
    return np.asarray((np.arctan(shape[2] / f) - angle) / slope * f)


def _angle_and_slope(ray: Floats, centre: Floats) -> tuple[Floats, Floats]:
    """Angle between the rays (x, y, 1) and (centre, 1), and the length of its gradient in the ray's x and y."""
    cx, cy = centre
    rx, ry = ray
    along = rx * cx + ry * cy + 1.0
    ax, ay, az = ry - cy, cx - rx, rx * cy - ry * cx  # ray x centre, rotated into a convenient order
    across = np.sqrt(ax * ax + ay * ay + az * az)
    length2 = rx * rx + ry * ry + 1.0
    # d(angle) = (along d(across) - across d(along)) / (across^2 + along^2), and across^2 + along^2 = |ray|^2 |centre|^2
    across = np.maximum(across, 1e-12)
    gx = (along * (-ay + az * cy) / across - across * cx) / (length2 * (cx * cx + cy * cy + 1.0))
    gy = (along * (ax - az * cx) / across - across * cy) / (length2 * (cx * cx + cy * cy + 1.0))
    return np.arctan2(across, along), np.maximum(np.hypot(gx, gy), 1e-12)


def lens(camera: Camera) -> tuple[float, float, float]:
    """Focal length and principal point, px; raises ValueError where a perspective camera lacks them."""
    if camera.focal_length_px is None or camera.principal_point_px is None:
        raise ValueError("a perspective camera needs focal_length_px and principal_point_px")
    return camera.focal_length_px, *camera.principal_point_px


def outline_px(camera: Camera, shape: Floats, azimuth_rad: Floats) -> tuple[Floats, Floats]:
    """Points (N, 2) of the outline and outward unit normals (N, 2), px; azimuth 0 is +x, counted towards +y."""
    cos, sin = np.cos(azimuth_rad), np.sin(azimuth_rad)
    if camera.projection == "orthographic":
        normal = np.stack([cos, sin], axis=-1)
        return shape[:2] + shape[2] * normal, normal
    f, px, py = lens(camera)
    axis = np.array([(shape[0] - px) / f, (shape[1] - py) / f, 1.0])
    axis /= np.linalg.norm(axis)
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    down = np.cross(axis, right)
    rim = axis + (shape[2] / f) * (cos[:, None] * right + sin[:, None] * down)
    points = f * rim[:, :2] / rim[:, 2:] + (px, py)
    tangent = _tangent(rim, right, down, cos, sin)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    return points, normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _tangent(rim: Floats, right: Floats, down: Floats, cos: Floats, sin: Floats) -> Floats:
    """Direction (N, 2) in the picture in which the projected rim runs as the azimuth grows."""
    step = cos[:, None] * down - sin[:, None] * right
    return np.asarray(step[:, :2] - rim[:, :2] / rim[:, 2:] * step[:, 2:])


def jacobian(camera: Camera, shape: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """Derivative (N, 3) of `depth_px` in the three numbers of the shape."""
    columns = []
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-3
        ahead, behind = (depth_px(camera, shape + s, x_px, y_px) for s in (step, -step))
        columns.append((ahead - behind) / 2e-3)
    return np.stack(columns, axis=-1)
