"""Circles that the edges of a photograph suggest, to about a pixel of a small copy of it.

The gradients of two edge points of a limb meet in its centre, whichever side is brighter: pairs drawn at random vote
for centre and radius (Xu, Oja & Kultanen 1990), and the fullest bins are refined on all edge points near them. What is
a ball is for others to say: circles are only counted by how much of their circumference lies on edges.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats, LinearImage

COARSE_PX = 640  # longer side of the small copy
PAIRS = 200_000
CANDIDATES = 60
BIN_PX = 4.0  # of votes, pixels of the small copy
REACH_PX = 10.0  # of the small copy, to which a circle may move in being refined
BINS = 72  # of the circumference
SMALLEST = 8.0  # radius in pixels of the small copy
SMOOTH = 1.0  # sd of the blur before edges, pixels of the small copy
NOISE_GRADIENT = 0.146  # sd of one component of the gradient that noise of sd 1 leaves after that blur
NOISE_SDS = 6.0
LEAST_ARC = 0.15  # of the circumference on edges


def circles(image: LinearImage, pick: tuple[float, float] | None, *, cut: bool = False) -> list[Floats]:
    """Distinct circles (3,) in px that lie inside the frame, those with the most of their circumference on edges first.

    `cut`: those that the frame cuts instead; `pick`: only circles around that place.
    """
    small, origin, step = _small(image)
    points, normals = _edges(small)
    if len(points) < 12:
        return []
    around = None if pick is None else (np.asarray(pick) - origin) / step
    found, arcs = _voted(points, normals, small.shape, around, cut)
    found = _distinct(found, arcs, [_contrast(small, circle) for circle in found])
    return [np.array([*(origin + step * circle[:2]), step * circle[2]]) for circle in found]


def _small(image: LinearImage) -> tuple[Floats, Floats, float]:
    """Brightness on a scale where noise has sd 1, where its first pixel lies and how far the next, px.

    Anscombe's square root, for shot and read noise (Murtagh, Starck & Bijaoui 1995); it tames highlights, too.
    """
    import cv2

    height, width = (min(p.values.shape[k] for p in image.planes) for k in (0, 1))
    by = max(max(height, width) / COARSE_PX, 1.0)
    total = np.zeros((round(height / by), round(width / by)), np.float32)
    for plane in image.planes:
        total += cv2.resize(plane.values[:height, :width], total.shape[::-1], interpolation=cv2.INTER_AREA)
    channel = [p.channel for p in image.planes]
    gain = float(np.mean(image.noise.gain[channel])) / by**2
    read2 = float(np.sum(image.noise.read[channel] ** 2)) / by**2
    gain, read2 = max(gain, 1e-9), max(read2, 1e-12)
    even = 2 / gain * np.sqrt(np.maximum(gain * total + 0.375 * gain**2 + read2, 0.0))
    first = np.mean([p.origin_px for p in image.planes], axis=0)
    own = image.planes[0].step_px
    return np.asarray(even, np.float32), first + own * (by - 1) / 2, float(own * by)


def _edges(even: Floats) -> tuple[Floats, Floats]:
    """Places (N, 2) where the gradient is greatest along itself and beyond noise, and its direction there."""
    import cv2

    smooth = cv2.GaussianBlur(even, (0, 0), SMOOTH)
    gx, gy = (np.asarray(cv2.Scharr(smooth, cv2.CV_32F, dx, 1 - dx), np.float32) / 32 for dx in (1, 0))
    strength = np.hypot(gx, gy)
    scale = 30000.0 / max(float(strength.max()), 1e-12)
    sx, sy = ((g * scale).astype(np.int16) for g in (gx, gy))
    high = max(float(np.percentile(strength, 98)) * 0.5, NOISE_SDS * NOISE_GRADIENT)
    edge = cv2.Canny(sx, sy, 0.3 * high * scale, high * scale, L2gradient=True) > 0
    row, column = np.nonzero(edge)
    normals = np.stack([gx[edge], gy[edge]], axis=1)
    return np.stack([column, row], axis=1).astype(float), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _voted(
    points: Floats, normals: Floats, shape: tuple[int, ...], pick: Floats | None, cut: bool
) -> tuple[list[Floats], list[float]]:
    """Refined circles of the fullest bins, and the share of the circumference that lies on edges."""
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, len(points), (2, PAIRS))
    cross = normals[a, 0] * normals[b, 1] - normals[a, 1] * normals[b, 0]
    fit = np.abs(cross) > 0.2
    a, b, cross = a[fit], b[fit], cross[fit]
    apart = points[b] - points[a]
    t = (apart[:, 0] * normals[b, 1] - apart[:, 1] * normals[b, 0]) / cross
    centre = points[a] + t[:, None] * normals[a]
    radius = np.abs(t)
    other = np.hypot(*(centre - points[b]).T)
    inside = (np.abs(radius - other) < 0.04 * radius + 1) & _within(centre, radius, shape, cut)
    if pick is not None:
        inside &= np.hypot(*(centre - pick).T) < radius
    votes = np.column_stack([centre, 0.5 * (radius + other)])[inside]
    if not len(votes):
        return [], []
    refined = [_refined(points, normals, circle) for circle in _fullest(votes)]
    refined = [c for c in refined if _within(c[None, :2], c[2:], shape, cut)[0]]
    return refined, [_arc(points, normals, circle) for circle in refined]


def _fullest(votes: Floats) -> list[Floats]:
    """The median vote of each of the fullest bins, by the votes that chance would put into bins of its radius."""
    bins = np.round(votes / BIN_PX).astype(np.int64)
    bins -= bins.min(axis=0)
    member = np.ravel_multi_index(tuple(bins.T), tuple(bins.max(axis=0) + 1))
    count = np.bincount(member)
    full = np.flatnonzero(count)
    radius = np.maximum(full % (bins[:, 2].max() + 1) + np.round(votes[:, 2] / BIN_PX).min(), 1.0)
    tops = full[np.argsort(count[full] / np.sqrt(radius))[-CANDIDATES:]]
    return [np.median(votes[member == k], axis=0) for k in tops]


def _within(centre: Floats, radius: Floats, shape: tuple[int, ...], cut: bool) -> Floats:
    """Which circles lie inside the frame, or have their centre and not all else there, and are not too small."""
    height, width = shape[:2]
    end = np.array([width, height]) - 1.0
    inside = np.all((centre - radius[:, None] > -2) & (centre + radius[:, None] < end + 2), axis=1)
    if not cut:
        return np.asarray((radius > SMALLEST) & inside)
    there = np.all((centre > 0) & (centre < end), axis=1) & (radius < max(height, width))
    return np.asarray((radius > SMALLEST) & there & ~inside)


def _near(points: Floats, normals: Floats, circle: Floats, within: float) -> Floats:
    x, y = points[:, 0] - circle[0], points[:, 1] - circle[1]
    distance = np.maximum(np.hypot(x, y), 1e-9)
    radial = np.abs(x * normals[:, 0] + y * normals[:, 1]) / distance
    return np.asarray((np.abs(distance - circle[2]) < within) & (radial > 0.96))


def _refined(points: Floats, normals: Floats, circle: Floats) -> Floats:
    """The circle through the edge points near it, a few times over."""
    around = np.abs(np.hypot(points[:, 0] - circle[0], points[:, 1] - circle[1]) - circle[2]) < REACH_PX
    points, normals = points[around], normals[around]
    for within in (4.0, 2.5, 1.5, 1.0, 1.0):
        near = points[_near(points, normals, circle, within)] - circle[:2]
        if len(near) < 8:
            return circle
        columns = np.column_stack([2 * near, np.ones(len(near))])
        ridge = 1e-9 * len(near) * np.eye(3)  # where all lie on a line
        x, y, c = np.linalg.solve(columns.T @ columns + ridge, columns.T @ np.sum(near**2, axis=1))
        circle = np.array([circle[0] + x, circle[1] + y, np.sqrt(max(c + x * x + y * y, 1.0))])
    return circle


def _arc(points: Floats, normals: Floats, circle: Floats) -> float:
    """Share of the circumference that has an edge along it."""
    away = points[_near(points, normals, circle, 1.6)] - circle[:2]
    turn = np.arctan2(away[:, 1], away[:, 0])
    return len(np.unique(np.floor(turn / (2 * np.pi) * BINS))) / BINS


def _contrast(even: Floats, circle: Floats) -> float:
    """Share of the circumference across which brightness jumps by more than it changes on either side."""
    import cv2

    turn = 2 * np.pi * np.arange(BINS) / BINS
    radius = circle[2] + np.array([[-7.0], [-2.5], [2.5], [7.0]])
    x, y = circle[0] + radius * np.cos(turn), circle[1] + radius * np.sin(turn)
    deep, inner, outer, far = cv2.remap(
        even, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    jump = np.abs(inner - outer) - np.abs(deep - inner) - np.abs(outer - far)
    range_ = float(np.max(deep)) - float(np.min(far))
    return float(np.mean(jump > max(0.1 * range_, 4.0)))


def _distinct(found: list[Floats], arcs: list[float], contrasts: list[float]) -> list[Floats]:
    """Circles that differ by more than their own errors, by arc and contrast; large ones first among near equals."""
    kept: list[Floats] = []
    merit = [(c + 0.4 * a) * f[2] ** 0.2 for f, a, c in zip(found, arcs, contrasts, strict=True)]
    for k in sorted(range(len(found)), key=lambda k: -merit[k]):
        if arcs[k] >= LEAST_ARC and all(np.abs(found[k] - c).max() > max(2.0, 0.04 * c[2]) for c in kept):
            kept.append(found[k])
    return kept
