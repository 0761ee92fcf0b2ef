"""Circles that edge points suggest: a randomised Hough transform over pairs of edge points and their directions.

Two points of a circle and the normals there meet in its centre, whichever side is brighter. Pairs drawn at random
vote for centre and radius; the fullest bins are refined on all edge points and ranked by how much of the
circumference they explain beyond chance. Source: Xu, Oja & Kultanen 1990.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .edges import EdgePoints

SECTORS = 60
PAIRS = 300_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Circles:
    """Candidates, best first: centre column, centre row, radius in samples, and the fraction of the limb explained."""

    shape: Floats  # (N, 3)
    support: Floats  # (N,)

    def __post_init__(self) -> None:
        readonly(self)


def circles(
    edges: EdgePoints, *, size: tuple[int, int], smallest: float, rng: np.random.Generator, most: int = 12
) -> Circles:
    """Circles that the edge points suggest, in a picture of `size` (columns, rows); at most `most`."""
    if len(edges.place) < 12:
        return Circles(shape=np.zeros((0, 3)), support=np.zeros(0))
    votes = _votes(edges, size, smallest, rng)
    shape = np.stack([_refined(edges, start) for start in _fullest(votes, 150)]) if len(votes) else np.zeros((0, 3))
    shape = shape[np.isfinite(shape).all(axis=1) & (shape[:, 2] >= smallest)]
    support = np.array([support_of(edges, s) for s in shape])
    return _distinct(shape, support, most)


def _votes(edges: EdgePoints, size: tuple[int, int], smallest: float, rng: np.random.Generator) -> Floats:
    """Centre and radius (N, 3) from each pair whose normals meet at equal distances from both points."""
    n = len(edges.place)
    order = np.lexsort((edges.place[:, 1], edges.place[:, 0] // 48))  # neighbours in the list are neighbours in place
    place, direction = edges.place[order], edges.direction[order]
    i = rng.integers(0, n, PAIRS)
    near = (i + rng.integers(1, max(n // 12, 2), PAIRS)) % n
    j = np.where(rng.random(PAIRS) < 0.5, near, rng.integers(0, n, PAIRS))
    a, b, u, v = place[i], place[j], direction[i], direction[j]
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    apart = b - a
    good = np.abs(cross) > 0.3
    safe = np.where(good, cross, 1.0)
    t = (apart[:, 0] * v[:, 1] - apart[:, 1] * v[:, 0]) / safe
    s = (apart[:, 0] * u[:, 1] - apart[:, 1] * u[:, 0]) / safe
    radius = 0.5 * (np.abs(t) + np.abs(s))
    centre = a + t[:, None] * u
    good &= (np.abs(np.abs(t) - np.abs(s)) < 1.0 + 0.06 * radius) & (radius >= smallest)
    good &= (radius < 0.75 * max(size)) & ((centre > 0) & (centre < np.array(size))).all(axis=1)
    return np.column_stack([centre, radius])[good]


def _fullest(votes: Floats, most: int) -> Floats:
    """The means (N, 3) of the votes in the fullest bins, whose width grows with the radius."""
    octave = np.floor(np.log2(votes[:, 2]) * 4.0)
    width = np.maximum(2.0, 0.12 * 2.0 ** (octave / 4.0))
    found = []
    for shift in (0.0, 0.5):
        cell = np.column_stack([np.floor(votes[:, :2] / width[:, None] + shift), octave]).astype(np.int64)
        key = (cell[:, 2] << 40) + (cell[:, 1] << 20) + cell[:, 0]
        _, where, count = np.unique(key, return_inverse=True, return_counts=True)
        total = np.stack([np.bincount(where, votes[:, k]) for k in range(3)], axis=-1)
        # small circles fill their bins less often: chance pairs fall in a bin as its volume
        volume = np.bincount(where, width) / count
        rank = np.argsort(-count / volume**0.5, kind="stable")[: most // 2]
        found.append(total[rank] / count[rank, None])
    return np.concatenate(found)


def _refined(edges: EdgePoints, start: Floats) -> Floats:
    """The circle after a few robust least-squares steps on all edge points near it."""
    shape = np.array(start, float)
    for tolerance in (0.10, 0.06, 0.04, 0.03, 0.03):
        depth, radial, near = _near(edges, shape, max(tolerance * shape[2], 1.5))
        if np.count_nonzero(near) < 8:
            return np.full(3, np.nan)
        weight = (1.0 - (depth[near] / max(tolerance * shape[2], 1.5)) ** 2) ** 2
        columns = np.column_stack([radial[near], np.ones(np.count_nonzero(near))])
        normal = (columns * weight[:, None]).T @ columns + 1e-6 * np.eye(3)
        shape = shape + np.linalg.solve(normal, (columns * weight[:, None]).T @ depth[near])
        if not 2.0 < shape[2] < 1e5:
            return np.full(3, np.nan)
    return shape


def _near(edges: EdgePoints, shape: Floats, tolerance: float) -> tuple[Floats, Floats, Floats]:
    """Distance outside the circle, outward directions, and which edge points lie along it."""
    away = edges.place - shape[:2]
    distance = np.maximum(np.linalg.norm(away, axis=-1), 1e-9)
    radial = away / distance[:, None]
    depth = distance - shape[2]
    along = np.abs(np.einsum("ij,ij->i", radial, edges.direction)) > 0.9
    return depth, radial, along & (np.abs(depth) < tolerance)


def support_of(edges: EdgePoints, shape: Floats) -> float:
    """Fraction of the circumference with an edge along it, less what circles of other radii find there by chance."""

    def sectors(radius: float) -> float:
        _, radial, near = _near(edges, np.array([shape[0], shape[1], radius]), max(1.5, 0.01 * radius))
        azimuth = np.arctan2(radial[near, 1], radial[near, 0])
        return len(np.unique(np.floor((azimuth / (2 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS)) / SECTORS

    chance = np.mean([sectors(shape[2] * k) for k in (0.8, 0.88, 1.12, 1.2)])
    return float(sectors(shape[2]) - chance)


def _distinct(shape: Floats, support: Floats, most: int) -> Circles:
    """The best of each group of nearly equal circles; larger ones win among those of like support."""
    kept: list[int] = []
    for k in np.argsort(-support * shape[:, 2] ** 0.25 if len(shape) else support, kind="stable"):
        if support[k] < 0.15 or len(kept) == most:
            break
        if all(np.abs(shape[k] - shape[m]).max() > max(0.05 * shape[m, 2], 2.0) for m in kept):
            kept.append(int(k))
    return Circles(shape=shape[kept], support=support[kept])
