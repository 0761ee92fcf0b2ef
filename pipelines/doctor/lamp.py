"""The light against the highlight: is it where a light in that direction would have it?"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.chrome import mirrored
from toolkit.geometry.highlight import LightFound
from toolkit.geometry.project import mirror_place, project
from toolkit.geometry.sphere import centre_position
from toolkit.records import Floats, Scene

from .records import Direction, Lamp, Pixel
from .samples import Ball

CONTRAST = 8.0  # of a highlight's top over the scatter of what Lambert leaves
LARGEST = 0.2  # share of the ball that a highlight may fill
GIVEN_SD_DEG = 0.5  # of a direction about whose error nothing is said
PLACE_SD_DEG = 1.0  # of what a highlight's middle tells at best
WIDTH_SHARE = 0.08  # of its radius: a rough highlight's top does not lie where a mirror's would
CERTAIN_DEG = 6.0  # what is shown must be known so well: of 48 turned directions one is always near


def lamp_of(scene: Scene, ball: Ball, own: LightFound | None, *, sd_deg: float | None) -> Lamp:
    """Of the scene's first light; `own` is what the ball itself tells of it, `sd_deg` of the light's direction."""
    light = scene.lights[0]
    towards = np.asarray(light.direction)
    normal = mirror_place(scene.camera, scene.sphere, light)
    seen, radius_deg = _highlight(scene, ball, towards if own is None else np.asarray(own.direction))
    shown, shown_sd = _shown(scene, own, seen, radius_deg)
    apart = None if shown is None else _apart_deg(shown, towards)
    tolerance = 3.0 * float(np.hypot(sd_deg or GIVEN_SD_DEG, shown_sd))
    return Lamp(
        direction=light.direction,
        sd_deg=sd_deg,
        source=scene.light_source,
        off_axis_deg=_apart_deg(towards, _view(scene)),
        expected_px=None if normal is None else _pixel(project(scene.camera, scene.sphere, normal[None])[0]),
        seen_px=seen,
        shown=None if shown is None else _direction(shown),
        apart_deg=apart,
        tolerance_deg=tolerance,
        instead=_instead(towards, shown, tolerance),
    )


def _shown(scene: Scene, own: LightFound | None, seen: Pixel | None, radius_deg: float) -> tuple[Floats | None, float]:
    """The direction that the ball shows, and its sd in degrees."""
    if scene.light_source == "given":
        return (None, 0.0) if own is None else (np.asarray(own.direction), own.sd_deg)
    if seen is None:
        return None, 0.0
    sd = float(np.hypot(PLACE_SD_DEG, 2 * WIDTH_SHARE * radius_deg))
    return mirrored(scene.camera, scene.sphere, *np.array(seen)[:, None])[0], sd


def _highlight(scene: Scene, ball: Ball, towards: Floats) -> tuple[Pixel | None, float]:
    """The middle of the brightest compact excess over Lambert's shading, and its radius in degrees of the surface."""
    bright = ball.value.mean(axis=1)
    excess = bright - _lambert(ball.normal @ towards, bright)
    scatter = 1.4826 * float(np.median(np.abs(excess - np.median(excess))))
    grid, index = _on_grid(ball, excess)
    labels, top = _compact(grid)
    if top < CONTRAST * scatter or top < 0.1 * float(np.median(bright)):
        return None, 0.0
    weight = np.where(labels[index], np.maximum(excess, 0.0), 0.0)
    area = np.count_nonzero(labels)
    if weight.sum() <= 0.0 or area > LARGEST * len(excess):
        return None, 0.0
    x, y = float(weight @ ball.x / weight.sum()), float(weight @ ball.y / weight.sum())
    radius_px = np.sqrt(area / np.pi) * ball.step_px
    return (x, y), float(np.degrees(radius_px / scene.sphere.radius_px))


def _lambert(cosine: Floats, bright: Floats) -> Floats:
    """The body's shading as the light has it, fitted where no highlight is: twice, the second time without its top."""
    columns = np.stack([np.maximum(cosine, 0.0), np.ones_like(cosine)], axis=1)
    keep = np.ones(len(bright), bool)
    fitted = np.zeros_like(bright)
    for _ in range(3):
        fitted = columns @ np.linalg.lstsq(columns[keep], bright[keep], rcond=None)[0]
        left = bright - fitted
        keep = left < 3.0 * 1.4826 * max(float(np.median(np.abs(left[keep]))), 1e-12)
    return np.asarray(fitted)


def _on_grid(ball: Ball, excess: Floats) -> tuple[Floats, tuple[NDArray[np.intp], NDArray[np.intp]]]:
    column = np.rint((ball.x - ball.x.min()) / ball.step_px).astype(np.intp)
    row = np.rint((ball.y - ball.y.min()) / ball.step_px).astype(np.intp)
    grid = np.zeros((row.max() + 1, column.max() + 1), np.float32)
    grid[row, column] = excess
    return grid, (row, column)


def _compact(grid: Floats) -> tuple[NDArray[np.bool_], float]:
    """The connected place above half of the greatest smoothed value, and that value."""
    import cv2

    smooth = cv2.GaussianBlur(grid, (0, 0), max(len(grid) / 150.0, 0.8))
    row, column = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
    top = float(smooth[row, column])
    _, labels = cv2.connectedComponents((smooth > 0.5 * top).astype(np.uint8))
    return np.asarray(labels == labels[row, column]), top


def _instead(towards: Floats, shown: Floats | None, tolerance_deg: float) -> Direction | None:
    """The same numbers with other signs or in another order, where the highlight agrees with those alone."""
    if shown is None or not tolerance_deg < min(CERTAIN_DEG, _apart_deg(towards, shown)):
        return None
    turned = [np.array(signs) * towards[list(order)] for order in permutations(range(3)) for signs in _SIGNS]
    best = min(turned, key=lambda one: _apart_deg(one, shown))
    near = _apart_deg(best, shown)
    return _direction(best) if near < tolerance_deg else None


_SIGNS = list(product((1.0, -1.0), repeat=3))


def _view(scene: Scene) -> Floats:
    if scene.camera.projection == "orthographic":
        return np.array([0.0, 0.0, 1.0])
    centre = centre_position(scene.camera, scene.sphere)
    return np.asarray(-centre / np.linalg.norm(centre))


def _apart_deg(a: Floats, b: Floats) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))))


def _direction(vector: Floats) -> Direction:
    x, y, z = (float(value) for value in vector)
    return x, y, z


def _pixel(place: Floats) -> Pixel:
    return float(place[0]), float(place[1])
