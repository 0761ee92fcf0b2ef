"""Pictures of a sphere as an ideal camera takes them: each pixel the mean radiance over its own square.

Every pixel is integrated by Gauss-Legendre with 2 x 2 points, exact for cubic surfaces; squares that an edge
crosses (outline, shadow terminator) or that the radiance bends within are quartered, again and again, down to
`1 / supersample` of a pixel, and in the middle of a highlight until they are small against it.
Nothing here knows the sums that the fit is made of.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import bounding_box, centre_position
from toolkit.records import Floats, Scene, readonly

from .materials import Material
from .shade import Shade, Shader

CHUNK = 16_384
SPREAD = 0.1  # relative difference between a square's four points above which it is quartered
FLOOR = 1e-3  # the same difference against a white Lambert plane: below it nothing is quartered
HIGHLIGHT_SIDES = 2.0  # squares nearer to a highlight's middle than this many of their sides may be quartered
_GAUSS = 0.5 / np.sqrt(3.0)
_CORNERS = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], float)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Render:
    """A rendered photograph without noise; layers (h, w, 3) on the sphere's box at `origin_px` (x, y).

    diffuse + specular + (1 - coverage) background + pedestal = radiance, and so everywhere: background + pedestal
    fill the frame around the box.
    """

    width_px: int
    height_px: int
    origin_px: tuple[int, int]
    diffuse: Floats
    specular: Floats
    coverage: Floats  # (h, w), the share of each pixel that the sphere fills
    background: Floats  # (3,)
    pedestal: Floats  # (3,)

    def __post_init__(self) -> None:
        readonly(self)

    def box_radiance(self) -> Floats:
        """Radiance (h, w, 3) on the sphere's box."""
        around = (1.0 - self.coverage)[..., None] * self.background
        return np.asarray(self.diffuse + self.specular + around + self.pedestal)

    def radiance(self) -> Floats:
        """Radiance (H, W, 3) of the whole frame."""
        return self.full(self.box_radiance(), self.background + self.pedestal)

    def full(self, layer: Floats, outside: Floats | float = 0.0) -> Floats:
        """A layer of the box (h, w, 3) in the whole frame (H, W, 3), filled up with `outside`."""
        frame = np.empty((self.height_px, self.width_px, 3))
        frame[...] = outside
        (x, y), (h, w) = self.origin_px, layer.shape[:2]
        frame[y : y + h, x : x + w] = layer
        return frame


def render(
    scene: Scene,
    material: Material,
    *,
    width_px: int,
    height_px: int,
    supersample: int = 8,
    background: Floats | float = 0.0,
    pedestal: Floats | float = 0.0,
) -> Render:
    """The sphere's picture in the units of the lights' irradiance over pi sr.

    `supersample` (a power of two) is the finest subdivision of a pixel's side, reached only where the radiance
    asks for it. `background` is the radiance around the sphere, `pedestal` is added everywhere; (3,) or one.
    """
    if supersample < 1 or supersample & (supersample - 1):
        raise ValueError(f"supersample is {supersample}; expected a power of two")
    x0, y0, x1, y1 = bounding_box(scene, width_px, height_px)
    y, x = (a.ravel().astype(float) for a in np.mgrid[y0:y1, x0:x1])
    touched = np.nonzero(_beyond_outline_px(scene, x, y) < np.sqrt(0.5))[0]
    shader = Shader(scene=scene, material=material)
    layers = np.zeros((len(x), 7))
    parts = [touched[start : start + CHUNK] for start in range(0, len(touched), CHUNK)]
    with ThreadPoolExecutor() as pool:  # numpy works outside the interpreter's lock
        done = pool.map(lambda part: _integrate(shader, x[part], y[part], 1.0, 1.0 / supersample), parts)
        for part, values in zip(parts, done, strict=True):
            layers[part] = values
    box = layers.reshape(y1 - y0, x1 - x0, 7)
    return Render(
        width_px=width_px,
        height_px=height_px,
        origin_px=(x0, y0),
        diffuse=box[..., :3],
        specular=box[..., 3:6],
        coverage=box[..., 6],
        background=np.broadcast_to(np.asarray(background, float), (3,)).copy(),
        pedestal=np.broadcast_to(np.asarray(pedestal, float), (3,)).copy(),
    )


def _integrate(shader: Shader, x: Floats, y: Floats, side_px: float, finest_px: float) -> Floats:
    """Means (N, 7) of diffuse, specular and coverage over squares of `side_px` around (x, y)."""
    dx, dy = (_CORNERS * _GAUSS * side_px).T[..., None]
    shade = shader((x + dx).ravel(), (y + dy).ravel())
    result = np.empty((len(x), 7))
    result[:, :3], result[:, 3:6] = _mean(shade.diffuse, len(x)), _mean(shade.specular, len(x))
    result[:, 6] = shade.on_sphere.reshape(4, len(x)).mean(axis=0)
    fine = _in_highlight(shader, shade, side_px)
    if side_px > finest_px:
        fine |= _uneven(shader, shade, side_px) | _on_outline(shader.scene, x, y, side_px)
    (chosen,) = np.nonzero(fine)
    if len(chosen):
        dx, dy = (_CORNERS * 0.25 * side_px).T[..., None]
        quarters = _integrate(shader, (x[chosen] + dx).ravel(), (y[chosen] + dy).ravel(), side_px / 2, finest_px)
        result[chosen] = quarters.reshape(4, len(chosen), 7).mean(axis=0)
    return result


def _mean(values: Floats, squares: int) -> Floats:
    """Mean (N, 3) over the four points of each square."""
    a, b, c, d = values.reshape(4, squares, 3)
    return np.asarray(0.25 * (a + b + c + d))


def _in_highlight(shader: Shader, shade: Shade, side_px: float) -> NDArray[np.bool_]:
    """Which squares lie in a highlight's middle and are not small against it."""
    side_rad = side_px / shader.scene.sphere.radius_px
    if side_rad < 0.5 * shader.highlight_rad:
        return np.zeros(len(shade.sin2_h) // 4, dtype=bool)
    return np.asarray(shade.sin2_h.reshape(4, -1).min(axis=0) < (HIGHLIGHT_SIDES * side_rad) ** 2)


def _uneven(shader: Shader, shade: Shade, side_px: float) -> NDArray[np.bool_]:
    """Which squares 2 x 2 points do not settle: the radiance bends within them, or a shadow begins there."""
    values = _total(shade.diffuse + shade.specular).reshape(4, -1)
    spread = values.max(axis=0) - values.min(axis=0)
    bent = spread > np.maximum(SPREAD * values.mean(axis=0), FLOOR * shader.irradiance.sum() / np.pi)
    shadow = shade.grazing.reshape(4, -1).min(axis=0) < side_px / shader.scene.sphere.radius_px
    return np.asarray(bent | shadow)


def _on_outline(scene: Scene, x: Floats, y: Floats, side_px: float) -> NDArray[np.bool_]:
    return np.asarray(np.abs(_beyond_outline_px(scene, x, y)) < np.sqrt(0.5) * side_px)


def _beyond_outline_px(scene: Scene, x: Floats, y: Floats) -> Floats:
    """Distance of pixel coordinates from the sphere's outline, positive outside; never overstated."""
    camera, sphere = scene.camera, scene.sphere
    if camera.projection == "orthographic":
        return np.asarray(np.hypot(x - sphere.centre_px[0], y - sphere.centre_px[1]) - sphere.radius_px)
    if camera.focal_length_px is None or camera.principal_point_px is None:
        raise ValueError("a perspective camera needs focal_length_px and principal_point_px")
    (px, py), f = camera.principal_point_px, camera.focal_length_px
    rays = np.stack([(x - px) / f, -(y - py) / f, np.full_like(x, -1.0)], axis=-1)
    centre = centre_position(camera, sphere)
    distance = float(np.linalg.norm(centre))
    across = np.linalg.norm(np.cross(rays, centre / distance), axis=-1)
    angle = np.arctan2(across, rays @ centre / distance)
    return np.asarray(f * (angle - np.arcsin(1.0 / distance)))


def _total(colour: Floats) -> Floats:
    return np.asarray(colour[:, 0] + colour[:, 1] + colour[:, 2])
