"""Is what lies inside a circle shaded as a ball, and from where is it lit?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .grid import Grid
from .stretches import level_of

MOST = 3000  # samples looked at
INNER = 0.93  # of the radius
ROUNDS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lit:
    """The light's direction (x and y as in the picture, z to the camera); the spread that shading does not explain."""

    direction: Floats  # (3,) unit
    unexplained: float  # 0: a matte ball under one light; 1: anything

    def __post_init__(self) -> None:
        readonly(self)


def lit_from(grid: Grid, shape: Floats) -> Lit:
    """A Lambertian ball under one light and a constant, fitted robustly: a highlight does not count."""
    normal, value = _inside(grid, shape)
    if len(value) < 30:
        return Lit(direction=np.array([0.0, 0.0, 1.0]), unexplained=1.0)
    bright = value > 0.4 * np.percentile(value, 95)
    vector = np.linalg.lstsq(normal[bright], value[bright], rcond=None)[0]
    weight, constant = np.ones(len(value)), 0.0
    left = value
    for _ in range(ROUNDS):
        lit = (normal @ vector > 0)[:, None]
        design = np.column_stack([normal * lit, np.ones(len(value))]) * weight[:, None]
        ridge = 1e-3 * len(value) * np.eye(4)  # of a crescent: the part towards the camera is hardly told
        solved = np.linalg.solve(design.T @ design + ridge * 1e-3, design.T @ (value * weight))
        vector, constant = solved[:3], float(solved[3])
        left = value - np.maximum(normal @ vector, 0.0) - constant
        scale = 1.4826 * float(np.median(np.abs(left))) + 1e-12
        weight = 1.0 / np.sqrt(1.0 + (left / (2 * scale)) ** 2)
    noise2 = float(np.median(grid.gain * np.maximum(value, 0.0) + grid.read**2))
    rms2 = max((1.4826 * float(np.median(np.abs(left)))) ** 2 - noise2, 0.0)
    spread = max(float(np.subtract(*np.percentile(value, [90, 10]))) / 2.56, 0.1 * level_of(grid, shape))
    length = float(np.linalg.norm(vector))
    return Lit(
        direction=vector / length if length > 0 else np.array([0.0, 0.0, 1.0]),
        unexplained=min(float(np.sqrt(rms2)) / max(spread, 3 * np.sqrt(noise2)), 1.0),
    )


def _inside(grid: Grid, shape: Floats) -> tuple[Floats, Floats]:
    """Normals (N, 3) in the picture's axes and values at up to `MOST` samples well inside."""
    height, width = grid.values.shape
    (cx, cy), r = (shape[:2] - grid.origin_px) / grid.step_px, shape[2] / grid.step_px
    by = max(int(np.sqrt(np.pi / MOST) * r), 1)
    row, column = np.mgrid[
        max(int(cy - r), 0) : min(int(cy + r) + 1, height) : by, max(int(cx - r), 0) : min(int(cx + r) + 1, width) : by
    ]
    nx, ny, value = (column.ravel() - cx) / r, (row.ravel() - cy) / r, grid.values[row.ravel(), column.ravel()]
    keep = (nx * nx + ny * ny < INNER**2) & np.isfinite(value)
    nx, ny, value = nx[keep], ny[keep], value[keep]
    return np.stack([nx, ny, np.sqrt(1 - nx * nx - ny * ny)], axis=-1), np.asarray(value, float)
