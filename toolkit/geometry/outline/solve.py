"""The sphere's three numbers from where the limb lies: geometric, weighted, robust."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, readonly

from .curve import depth_px, jacobian

LEAST = 6  # segments


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Centre x, y and radius in px with covariance; which limb points agree; their excess scatter, px."""

    shape: Floats  # (3,)
    covariance: Floats  # (3, 3)
    agree: NDArray[np.bool_]  # (N,)
    excess_px: float

    def __post_init__(self) -> None:
        readonly(self)


def solve(
    camera: Camera, shape: Floats, points_px: Floats, sd_px: Floats, *, rng: np.random.Generator
) -> Solution | None:
    """Fit the outline to limb points (N, 2) with sd along the normal; None where too few agree."""
    if len(points_px) < LEAST:
        return None
    agree = _consensus(camera, shape, points_px, sd_px, rng)
    if np.count_nonzero(agree) < LEAST:
        return None
    excess = 0.0
    shape = np.array(shape, float)
    for _ in range(8):
        shape = shape + _step(camera, shape, points_px[agree], np.hypot(sd_px, excess)[agree])[0]
        distance = depth_px(camera, shape, points_px[:, 0], points_px[:, 1])
        excess = _excess(distance[agree], sd_px[agree])
        agree = np.abs(distance) < np.maximum(3.5 * np.hypot(sd_px, excess), 0.02)
        if np.count_nonzero(agree) < LEAST:
            return None
    step, covariance = _step(camera, shape, points_px[agree], np.hypot(sd_px, excess)[agree])
    return Solution(shape=shape + step, covariance=covariance, agree=agree, excess_px=excess)


def _step(camera: Camera, shape: Floats, points: Floats, sd: Floats) -> tuple[Floats, Floats]:
    """One Gauss-Newton step and the covariance."""
    j = jacobian(camera, shape, points[:, 0], points[:, 1]) / sd[:, None]
    residual = -depth_px(camera, shape, points[:, 0], points[:, 1]) / sd
    covariance = np.linalg.inv(j.T @ j + 1e-9 * np.eye(3))
    return covariance @ (j.T @ residual), covariance


def _consensus(camera: Camera, shape: Floats, points: Floats, sd: Floats, rng: np.random.Generator) -> NDArray[Any]:
    """The points that the best of many three-point outlines agrees with; linear in the shape, for it is near."""
    x, y = points[:, 0], points[:, 1]
    j, depth = jacobian(camera, shape, x, y), depth_px(camera, shape, x, y)
    trio = np.stack([rng.permutation(len(points))[:3] for _ in range(400)])
    a = j[trio] + 0.0
    good = np.abs(np.linalg.det(a)) > 0.02
    if not good.any():
        return np.ones(len(points), bool)
    shift = np.linalg.solve(a[good], -depth[trio[good]][..., None])[..., 0]
    scale = np.maximum(2.5 * sd, 0.25 * float(np.median(sd)) + 1e-6)
    reach = np.maximum(scale, 0.15)
    miss = np.minimum(((depth + shift @ j.T) / reach) ** 2, 1.0)
    cost = (miss * (1.0 / (1.0 + (sd / np.median(sd)) ** 2))).sum(axis=1)
    return np.asarray(miss[np.argmin(cost)] < 1.0)


def _excess(distance: Floats, sd: Floats) -> float:
    """The scatter, px, that the points show beyond their sd: where the reduced chi-square becomes 1."""
    low, high = 0.0, float(np.sqrt(np.mean(distance**2))) + 1e-9
    freedom = max(len(distance) - 3, 1)
    if np.sum((distance / sd) ** 2) <= freedom:
        return 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        above = np.sum(distance**2 / (sd**2 + middle**2)) > freedom
        low, high = (middle, high) if above else (low, middle)
    return high
