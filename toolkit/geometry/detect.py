"""Find the ball in a photograph: a plain detection, good to about a pixel, that the fit then refines.

Edge points of the picture vote in pairs for circles: the gradients of two points of a limb meet in its centre. Of the
circles that most of a limb supports the largest is taken, its limb located along radii where brightness changes
fastest, and the sphere whose outline passes there fitted robustly. The terminator is no circle and fades, the border of
a highlight fades; neither gathers the votes that a limb does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Camera, Floats, Sphere

COARSE_PX = 480  # longer side of the picture in which circles are sought
PAIRS = 200_000
CANDIDATES = 60
BINS = 72  # of the circumference, to count how much of it is seen
LEAST_ARC = 0.3  # of the circumference on edges, below which there is no ball
LEAST_LIMB, SURE_LIMB = 0.28, 0.42  # of the circumference with a limb that can be located
RADII = 360  # along which the limb is located
WEAKEST = 0.35  # slope of a limb, of the steepest tenth's: the terminator is fainter
WORST_SCATTER = 0.6  # of the limb about the outline, in samples and a hundredth of the radius
SYSTEMATIC_PX = 0.8  # the steepest place of a shaded limb lies this near to it, blur included


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A sphere and how well it was seen: `arc` of the circumference used, scatter of the limb about the outline."""

    sphere: Sphere
    arc: float
    scatter_px: float
    uncertain: bool


def find_sphere(
    picture: Floats,
    *,
    origin_px: tuple[float, float],
    step_px: float,
    camera: Camera,
    pick: tuple[float, float] | None = None,
) -> Found:
    """The best seen whole ball of a linear picture (h, w, 3) placed as in `Plane`, or the one around `pick` (x, y).

    Raises BadInputError where there is none.
    """
    linear = np.maximum(picture.mean(axis=2), 0.0).astype(np.float32)
    placed = None if pick is None else ((pick[0] - origin_px[0]) / step_px, (pick[1] - origin_px[1]) / step_px)
    circle = _coarse(np.sqrt(linear), placed)  # of the root: noise even, highlights tamed
    points = _limb(linear, circle)
    x = origin_px[0] + step_px * points[:, 0]
    y = origin_px[1] + step_px * points[:, 1]
    start = np.array([*(np.asarray(origin_px) + step_px * circle[:2]), step_px * circle[2]])
    shape, covariance, arc, scatter = _fitted(x, y, start, camera, step_px)
    if arc < LEAST_LIMB or scatter > WORST_SCATTER * max(step_px, 0.01 * shape[2]):
        raise _none()
    uncertain = arc < SURE_LIMB or float(np.hypot(*(shape[:2] - start[:2]))) > 0.03 * shape[2]
    systematic = SYSTEMATIC_PX * (2.0 if uncertain else 1.0)
    sphere = Sphere(
        centre_px=(float(shape[0]), float(shape[1])),
        radius_px=float(shape[2]),
        covariance_px2=covariance + systematic**2 * np.eye(3),
        source="detected",
    )
    return Found(sphere=sphere, arc=arc, scatter_px=scatter, uncertain=uncertain)


def _none() -> BadInputError:
    return BadInputError("no sphere found: expected a whole ball against its background; give --sphere CX,CY,R")


def _coarse(bright: Floats, pick: tuple[float, float] | None) -> Floats:
    """Centre and radius (3,) in the picture's pixels, to a few of them."""
    import cv2

    factor = max(max(bright.shape) / COARSE_PX, 1.0)
    size = (round(bright.shape[1] / factor), round(bright.shape[0] / factor))
    small = cv2.GaussianBlur(cv2.resize(bright, size, interpolation=cv2.INTER_AREA), (0, 0), 1.0)
    points, normals = _edges(*(np.asarray(cv2.Scharr(small, cv2.CV_32F, dx, 1 - dx), np.float32) for dx in (1, 0)))
    if len(points) < 30:
        raise _none()
    found = _voted(points, normals, small.shape, None if pick is None else np.asarray(pick) / factor)
    return np.array([found[0] * factor + (factor - 1) / 2, found[1] * factor + (factor - 1) / 2, found[2] * factor])


def _edges(gx: Floats, gy: Floats) -> tuple[Floats, Floats]:
    """Places (N, 2) where the gradient is greatest along itself, and its direction there."""
    import cv2

    scale = 30000.0 / max(float(np.hypot(gx, gy).max()), 1e-12)
    sx, sy = ((g * scale).astype(np.int16) for g in (gx, gy))
    strength = np.hypot(gx, gy) * scale
    high = max(float(np.percentile(strength, 98)) * 0.5, 300.0)
    edge = cv2.Canny(sx, sy, 0.3 * high, high, L2gradient=True) > 0
    row, column = np.nonzero(edge)
    normals = np.stack([gx[edge], gy[edge]], axis=1)
    return np.stack([column, row], axis=1).astype(float), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _voted(points: Floats, normals: Floats, shape: tuple[int, ...], pick: Floats | None) -> Floats:
    """The circle (3,) with the most of its circumference on edges, large ones first among near equals."""
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, len(points), (2, PAIRS))
    cross = normals[a, 0] * normals[b, 1] - normals[a, 1] * normals[b, 0]
    fit = np.abs(cross) > 0.2
    a, b, cross = a[fit], b[fit], cross[fit]
    apart = points[b] - points[a]
    t = (apart[:, 0] * normals[b, 1] - apart[:, 1] * normals[b, 0]) / cross
    centre = points[a] + t[:, None] * normals[a]
    radius = np.abs(t)
    other = np.linalg.norm(centre - points[b], axis=1)
    height, width = shape[:2]
    inside = (
        (np.abs(radius - other) < 0.04 * radius + 1)
        & (radius > 8)
        & (radius < 0.55 * max(height, width))
        & (centre[:, 0] - radius > -2)
        & (centre[:, 1] - radius > -2)
        & (centre[:, 0] + radius < width + 1)
        & (centre[:, 1] + radius < height + 1)
    )
    if pick is not None:
        inside &= np.linalg.norm(centre - pick, axis=1) < radius
    circles = np.column_stack([centre, 0.5 * (radius + other)])[inside]
    if not len(circles):
        raise _none()
    cells = np.round(circles / 4.0)
    kinds, member, votes = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    tops = np.argsort(votes / np.sqrt(kinds[:, 2]))[-CANDIDATES:]
    refined = [_refined(points, normals, np.median(circles[member.ravel() == k], axis=0)) for k in tops]
    arcs = np.array([_arc(points, normals, circle) for circle in refined])
    if arcs.max() < LEAST_ARC:
        raise _none()
    good = [c for c, arc in zip(refined, arcs, strict=True) if arc >= max(0.8 * arcs.max(), LEAST_ARC)]
    return max(good, key=lambda c: float(c[2]))


def _near(points: Floats, normals: Floats, circle: Floats, within: float) -> Floats:
    away = points - circle[:2]
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    radial = np.abs(np.sum(away * normals, axis=1)) / distance
    return np.asarray((np.abs(distance - circle[2]) < within) & (radial > 0.9))


def _refined(points: Floats, normals: Floats, circle: Floats) -> Floats:
    """The circle through the edge points near it, a few times over."""
    for within in (4.0, 2.5, 1.5, 1.5):
        near = points[_near(points, normals, circle, within)]
        if len(near) < 8:
            return circle
        columns = np.column_stack([2 * near, np.ones(len(near))])
        x, y, c = np.linalg.lstsq(columns, np.sum(near**2, axis=1), rcond=None)[0]
        circle = np.array([x, y, np.sqrt(max(c + x * x + y * y, 1.0))])
    return circle


def _arc(points: Floats, normals: Floats, circle: Floats) -> float:
    """Share of the circumference that has an edge along it."""
    away = points[_near(points, normals, circle, 1.6)] - circle[:2]
    turn = np.arctan2(away[:, 1], away[:, 0])
    return len(np.unique(np.floor(turn / (2 * np.pi) * BINS))) / BINS


def _limb(bright: Floats, circle: Floats) -> Floats:
    """Sub-pixel places (N, 2) along radii where the brightness changes fastest near a circle."""
    import cv2

    reach = max(0.06 * circle[2], 4.0)
    along = np.arange(-reach, reach, 0.25)
    turn = 2 * np.pi * np.arange(RADII) / RADII
    r = circle[2] + along
    x = (circle[0] + r * np.cos(turn)[:, None]).astype(np.float32)
    y = (circle[1] + r * np.sin(turn)[:, None]).astype(np.float32)
    profile = cv2.remap(bright, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    profile = cv2.GaussianBlur(profile, (0, 0), sigmaX=3.0, sigmaY=0.7)  # along the radius, then across
    slope = np.abs(np.gradient(profile, axis=1))
    slope[:, :8] = slope[:, -8:] = 0.0
    peak = np.clip(np.argmax(slope, axis=1), 1, len(along) - 2)
    rows = np.arange(RADII)
    before, at, after = slope[rows, peak - 1], slope[rows, peak], slope[rows, peak + 1]
    bend = before - 2 * at + after
    shift = np.where(bend < 0, 0.5 * (before - after) / np.minimum(bend, -1e-12), 0.0)
    noise = np.median(slope, axis=1)
    strong = (at > 4 * noise) & (at > WEAKEST * np.percentile(at, 90))
    radius = circle[2] + along[peak] + 0.25 * np.clip(shift, -1, 1)
    places = np.column_stack([circle[0] + radius * np.cos(turn), circle[1] + radius * np.sin(turn)])
    return np.asarray(places[strong])


def _fitted(x: Floats, y: Floats, start: Floats, camera: Camera, step_px: float) -> tuple[Floats, Floats, float, float]:
    """Centre and radius (3,) of the sphere through limb places, covariance, arc seen, scatter in px."""
    from scipy.optimize import least_squares

    if len(x) < 20:
        raise _none()
    fit: Any = least_squares(_beyond, start, args=(x, y, camera), loss="soft_l1", f_scale=0.3 * step_px)
    beyond = _beyond(fit.x, x, y, camera)
    scatter = max(1.4826 * float(np.median(np.abs(beyond - np.median(beyond)))), 0.02)
    near = np.abs(beyond) < max(4 * scatter, 0.75 * step_px)
    if near.sum() < 20:
        raise _none()
    final: Any = least_squares(_beyond, fit.x, args=(x[near], y[near], camera))
    turn = np.arctan2(y[near] - final.x[1], x[near] - final.x[0])
    arc = len(np.unique(np.floor(turn / (2 * np.pi) * BINS))) / BINS
    covariance = np.linalg.inv(final.jac.T @ final.jac) * scatter**2 * 4  # neighbours along the limb share their error
    return final.x, covariance, arc, scatter


def _beyond(shape: Floats, x: Floats, y: Floats, camera: Camera) -> Floats:
    """How far (px) places lie beyond the outline of a sphere: its cone of sight, or its circle."""
    if camera.projection == "orthographic" or camera.focal_length_px is None or camera.principal_point_px is None:
        return np.asarray(np.hypot(x - shape[0], y - shape[1]) - shape[2])
    f, (px, py) = camera.focal_length_px, camera.principal_point_px
    rays = np.stack([x - px, y - py, np.full_like(x, f)], axis=1)
    axis = np.array([shape[0] - px, shape[1] - py, f])
    cross = np.linalg.norm(np.cross(rays, axis), axis=1)
    angle = np.arctan2(cross, rays @ axis)
    return np.asarray((angle - np.arctan(shape[2] / f)) * f)
