"""The outline in the picture, a circle or the ellipse that perspective makes of it: depth of places below it.

Both are the rays at the angular radius from the sphere's centre, so one signed distance serves both and the fit works
in the Sphere record's own three numbers: no ellipse has to be turned into a direction afterwards.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Camera, Floats


def lens(camera: Camera) -> tuple[float, float, float] | None:
    """Focal length and principal point, px, of a perspective camera; None for an orthographic one."""
    if camera.projection == "orthographic":
        return None
    if camera.focal_length_px is None or camera.principal_point_px is None:
        raise ValueError("a perspective camera needs focal_length_px and principal_point_px")
    return camera.focal_length_px, *camera.principal_point_px


def angular_radius(camera: Camera, radius_px: float) -> float:
    """Angle, rad, between the axis to the sphere's centre and its outline; 0 for an orthographic camera."""
    seen = lens(camera)
    return 0.0 if seen is None else float(np.arctan(radius_px / seen[0]))


def depth_px(camera: Camera, shape: Floats, x_px: Floats, y_px: Floats) -> Floats:
    """Distance inside the outline along its normal, px (negative outside), to first order about the outline.

    `shape` is (centre x, centre y, radius) as in `Sphere`.
    """
    seen = lens(camera)
    if seen is None:
        return np.asarray(shape[2] - np.hypot(x_px - shape[0], y_px - shape[1]))
    f, px, py = seen
    rx, ry = (x_px - px) / f, (y_px - py) / f
    cx, cy = (shape[0] - px) / f, (shape[1] - py) / f
    along = rx * cx + ry * cy + 1.0
    ax, ay, az = ry - cy, cx - rx, rx * cy - ry * cx  # ray x centre
    across = np.maximum(np.sqrt(ax * ax + ay * ay + az * az), 1e-12)
    # d(angle) = (along d(across) - across d(along)) / (across^2 + along^2), and across^2 + along^2 = |ray|^2 |centre|^2
    size = (rx * rx + ry * ry + 1.0) * (cx * cx + cy * cy + 1.0)
    gx = (along * (az * cy - ay) / across - across * cx) / size
    gy = (along * (ax - az * cx) / across - across * cy) / size
    angle = np.arctan2(across, along)
    return np.asarray((np.arctan(shape[2] / f) - angle) / np.maximum(np.hypot(gx, gy), 1e-12) * f)


def outline_px(camera: Camera, shape: Floats, azimuth_rad: Floats) -> Floats:
    """Points (N, 2) of the outline, px; azimuth 0 lies towards +x, counted towards +y."""
    cos, sin = np.cos(azimuth_rad), np.sin(azimuth_rad)
    seen = lens(camera)
    if seen is None:
        return np.asarray(shape[:2] + shape[2] * np.stack([cos, sin], axis=-1))
    f, px, py = seen
    axis = np.array([(shape[0] - px) / f, (shape[1] - py) / f, 1.0])
    axis /= np.linalg.norm(axis)
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    down = np.cross(axis, right)
    rim = axis + (shape[2] / f) * (cos[:, None] * right + sin[:, None] * down)
    return np.asarray(f * rim[:, :2] / rim[:, 2:] + (px, py))
