"""The samples along the light's plane, and what each fit predicts for those very samples.

The plane through the sphere's centre, the camera and the light cuts the sphere in a great circle: along it the
surface turns from facing away from the light to facing it, through the highlight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.sphere import surface
from toolkit.records import Fit, Floats, LinearImage, MaterialReport, Plane, Scene, readonly

STRIP = 0.012  # half the strip's width over the radius: 0.7 degrees of the surface
MOST_SAMPLES = 30_000
BINS = 150


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """Where the light's plane meets the picture, and how angles are counted along it."""

    along: Floats  # (2,) unit, pixel coordinates, towards the light
    in_plane: Floats  # (3,) unit, camera frame, at right angles to `view`
    view: Floats  # (3,) unit, towards the camera
    light_deg: float  # angle of the light from the view
    half_deg: float  # where a mirror would show it

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bins:
    """One channel's samples in bins of the surface's angle: weighted means and their sds (B,)."""

    channel: int
    angle_deg: Floats
    value: Floats
    sd: Floats
    fits: Floats  # (fits, B), predictions averaged with the same weights

    def __post_init__(self) -> None:
        readonly(self)


def light_line(scene: Scene) -> Line:
    """The line of the first light."""
    sphere = scene.sphere
    x, y = (np.array([c]) for c in sphere.centre_px)
    view = surface(scene.camera, sphere, x, y).view[0]
    light = np.asarray(scene.lights[0].at(np.zeros((1, 3)))[0][0])
    across = light - (light @ view) * view
    length = np.linalg.norm(across)
    in_plane = across / length if length > 1e-3 else _sideways(view)
    light_deg = float(np.degrees(np.arctan2(light @ in_plane, light @ view)))
    along = _projected(scene, in_plane)
    return Line(along=along, in_plane=in_plane, view=view, light_deg=light_deg, half_deg=light_deg / 2)


def _sideways(view: Floats) -> Floats:
    right = np.array([1.0, 0.0, 0.0]) - view[0] * view
    return np.asarray(right / np.linalg.norm(right))


def _projected(scene: Scene, direction: Floats) -> Floats:
    """The picture's direction (2,) of a small step from the sphere's centre."""
    camera = scene.camera
    if camera.projection == "orthographic" or camera.focal_length_px is None or camera.principal_point_px is None:
        step = np.array([direction[0], -direction[1]])
    else:
        ray = (np.asarray(scene.sphere.centre_px) - camera.principal_point_px) / camera.focal_length_px
        step = np.array([direction[0] + ray[0] * direction[2], -direction[1] + ray[1] * direction[2]])
    return np.asarray(step / np.linalg.norm(step))


def angle_deg(scene: Scene, line: Line, x_px: Floats, y_px: Floats) -> Floats:
    """How far the surface is turned towards the light (N,), degrees from facing the camera."""
    normal = surface(scene.camera, scene.sphere, x_px, y_px).normal
    return np.asarray(np.degrees(np.arctan2(normal @ line.in_plane, normal @ line.view)))


def positions(scene: Scene, line: Line, steps: Floats) -> tuple[Floats, Floats]:
    """Pixel coordinates at `steps` radii from the centre along the line."""
    distance = steps * scene.sphere.radius_px
    cx, cy = scene.sphere.centre_px
    return cx + distance * line.along[0], cy + distance * line.along[1]


def binned(report: MaterialReport, fits: tuple[Fit, ...], channel: int, *, edges_deg: Floats) -> Bins:
    """The unclipped samples of one channel within the strip, and the fits, the best first, at the same places."""
    from toolkit.inference.layers import predict

    scene = fits[0].scene
    line = light_line(scene)
    x, y, value = _strip(report.image, scene, line, channel, edges_deg)
    angle = angle_deg(scene, line, x, y)
    predicted = np.array([predict(fit, x, y).model[:, channel] for fit in fits]).reshape(len(fits), len(x))
    weight = 1.0 / report.image.noise.variance(predicted[0], channel)
    index = np.digitize(angle, edges_deg) - 1
    count = len(edges_deg) - 1

    def mean(values: Floats) -> Floats:
        return np.bincount(index, weight * values, count)[:count] / total

    total = np.bincount(index, weight, count)[:count]
    with np.errstate(divide="ignore", invalid="ignore"):
        means = [mean(row) for row in (angle, value, *predicted)]
        sd = np.sqrt(1.0 / total)
    full = total > 0.0
    stacked = np.array(means)[:, full]
    return Bins(channel=channel, angle_deg=stacked[0], value=stacked[1], sd=sd[full], fits=stacked[2:])


def _strip(
    image: LinearImage, scene: Scene, line: Line, channel: int, edges_deg: Floats
) -> tuple[Floats, Floats, Floats]:
    """Places and values of the usable samples of a channel: on the sphere, in the strip, between the outer edges."""
    found = [_of_plane(plane, scene, line) for plane in image.planes if plane.channel == channel]
    x, y, value = (np.concatenate(part) for part in zip(*found, strict=True))
    keep = surface(scene.camera, scene.sphere, x, y).on_sphere
    angle = angle_deg(scene, line, x, y)
    keep = keep & (angle >= edges_deg[0]) & (angle < edges_deg[-1])
    chosen = np.flatnonzero(keep)
    chosen = chosen[:: max(1, -(-len(chosen) // MOST_SAMPLES))]
    return x[chosen], y[chosen], value[chosen]


def _of_plane(plane: Plane, scene: Scene, line: Line) -> tuple[Floats, Floats, Floats]:
    """The samples nearest to a fine grid laid along the strip."""
    radius, step = scene.sphere.radius_px, plane.step_px
    half = max(STRIP * radius, 0.75 * step)
    s = np.arange(-1.05 * radius, 1.05 * radius, 0.7 * step)
    t = np.linspace(-half, half, max(3, int(np.ceil(2 * half / (0.7 * step)))))
    cx, cy = scene.sphere.centre_px
    along, across = line.along, np.array([-line.along[1], line.along[0]])
    x = cx + s[:, None] * along[0] + t * across[0]
    y = cy + s[:, None] * along[1] + t * across[1]
    column = np.rint((x - plane.origin_px[0]) / step).astype(int)
    row = np.rint((y - plane.origin_px[1]) / step).astype(int)
    h, w = plane.values.shape
    inside = (column >= 0) & (column < w) & (row >= 0) & (row < h)
    flat = np.unique(row[inside] * w + column[inside])
    row, column = np.divmod(flat[plane.flags.ravel()[flat] == 0], w)
    values = plane.values[row, column].astype(float)
    return plane.origin_px[0] + step * column, plane.origin_px[1] + step * row, values
