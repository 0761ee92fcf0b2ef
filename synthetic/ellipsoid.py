"""A ball that is no ball: the picture of an ellipsoid, for what a fit that believes in a sphere makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.records import Floats, Scene
from toolkit.reflectance.cosines import Cosines

from .materials import Material
from .render import Render
from .shade import body, gloss

SUBSAMPLES = 4  # per pixel and axis
MARGIN_PX = 2


def ellipsoid(picture: Render, scene: Scene, material: Material, *, stretch: float, around_deg: float) -> Render:
    """The picture with the sphere replaced by one stretched by `1 + stretch` along an axis across the view.

    The axis is turned by `around_deg` from right towards up. Orthographic scenes only; raises ValueError on others.
    """
    if scene.camera.projection != "orthographic":
        raise ValueError("an ellipsoid is drawn for an orthographic camera only")
    half = int(np.ceil(scene.sphere.radius_px * (1.0 + stretch))) + MARGIN_PX
    x0, y0 = (max(round(c) - half, 0) for c in scene.sphere.centre_px)
    x1, y1 = (
        min(round(c) + half + 1, size)
        for c, size in zip(scene.sphere.centre_px, (picture.width_px, picture.height_px), strict=True)
    )
    row, column = np.mgrid[y0:y1, x0:x1]
    layers = np.zeros((y1 - y0, x1 - x0, 7))
    steps = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    for dy in steps:
        for dx in steps:
            layers += _shaded(column + dx, row + dy, scene, material, stretch, np.radians(around_deg))
    layers /= SUBSAMPLES**2
    return replace(
        picture, origin_px=(x0, y0), diffuse=layers[..., :3], specular=layers[..., 3:6], coverage=layers[..., 6]
    )


def _shaded(x: Floats, y: Floats, scene: Scene, material: Material, stretch: float, around: float) -> Floats:
    """Diffuse, specular and coverage (h, w, 7) at pixel coordinates."""
    (cx, cy), radius = scene.sphere.centre_px, scene.sphere.radius_px
    right, up = (x - cx) / radius, -(y - cy) / radius
    along, across = right * np.cos(around) + up * np.sin(around), up * np.cos(around) - right * np.sin(around)
    slope = along / (1.0 + stretch) ** 2
    height2 = 1.0 - along * slope - across**2
    inside = height2 > 0.0
    depth = np.sqrt(np.maximum(height2, 0.0))
    normal = np.stack(
        [
            slope * np.cos(around) - across * np.sin(around),
            slope * np.sin(around) + across * np.cos(around),
            depth,
        ],
        axis=-1,
    )[inside]
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    view = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
    result = np.zeros((*x.shape, 7))
    for light in scene.lights:
        towards, irradiance = light.at(normal)
        cosines = Cosines.of(normal, towards, view)
        result[inside, :3] += irradiance * body(material, cosines)
        result[inside, 3:6] += irradiance * gloss(material, cosines)
    result[inside, 6] = 1.0
    return result
