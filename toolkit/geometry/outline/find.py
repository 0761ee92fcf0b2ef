"""Find the sphere in a photograph: coarse circles first, then the limb to a fraction of a pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.records import Camera, Floats, Noise, Sphere, readonly

from .curve import depth_px
from .edges import edge_points, even_noise
from .hough import circles
from .limb import Weighing, edge_places
from .profiles import Grid, profiles
from .solve import Solution, solve

COARSE = 640  # samples along the longer side where circles are sought


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """A sphere found, and how well: `uncertain` with its reason in words, the limb's arc that was used."""

    sphere: Sphere
    uncertain: bool
    reason: str
    arc: float  # fraction of the circumference used
    scatter_px: float  # of the limb's places about the outline, beyond their own noise
    limb_px: Floats  # (N, 2), the limb places used

    def __post_init__(self) -> None:
        readonly(self)


def find_sphere(
    picture: Floats,
    *,
    origin_px: tuple[float, float] | Sequence[tuple[float, float]] = (0.0, 0.0),
    step_px: float = 1.0,
    noise: Noise | None = None,
    camera: Camera | None = None,
    flags: NDArray[np.uint8] | None = None,
    pick: tuple[float, float] | None = None,
    seed: int = 0,
) -> Outline:
    """The largest sphere of a linear picture (h, w, 3), or the one around `pick` (x, y in px).

    Pixel (row, column) lies at origin_px + step_px * (column, row); `origin_px` may be one place per channel (a
    mosaic's quads). `flags` (h, w) are SampleFlag. Raises BadInputError where no whole sphere is found.
    """
    rng = np.random.default_rng(seed)
    camera = camera or Camera()
    grid = _grid(picture, origin_px, step_px, noise, flags)
    coarse = _smaller(grid, max(1, int(np.ceil(max(picture.shape[:2]) / COARSE))))
    edges = edge_points(even_noise(coarse.values, coarse.gain, coarse.read), threshold=3.0, most=10_000, rng=rng)
    found = circles(edges, size=picture_size(coarse), smallest=8.0, rng=rng)
    outlines = []
    for start in found.shape:
        shape = np.array([*(coarse.origin_px.mean(axis=0) + coarse.step_px * start[:2]), coarse.step_px * start[2]])
        outline = _outline(grid, coarse, camera, shape, rng)
        if outline is not None:
            outlines.append(outline)
    return _chosen(outlines, pick)


def _chosen(outlines: list[Outline], pick: tuple[float, float] | None) -> Outline:
    for outline in sorted(outlines, key=lambda o: -o.sphere.radius_px):
        (cx, cy), r = outline.sphere.centre_px, outline.sphere.radius_px
        if pick is None or np.hypot(pick[0] - cx, pick[1] - cy) < r:
            return outline
    raise BadInputError("no sphere found: expected a whole ball against its background; give --sphere CX,CY,R")


def _grid(
    picture: Floats,
    origin_px: tuple[float, float] | Sequence[tuple[float, float]],
    step_px: float,
    noise: Noise | None,
    flags: NDArray[np.uint8] | None,
) -> Grid:
    values = np.asarray(picture, np.float32)
    used = np.isfinite(values).all(axis=2)
    if flags is not None:
        used &= (np.asarray(flags) & 4) == 0
    origin = np.broadcast_to(np.asarray(origin_px, float), (3, 2))
    if noise is None:
        rough = np.nanmedian(np.abs(np.diff(values, axis=0)), axis=(0, 1)) * 1.05
        gain, read = np.full(3, 1e-4), np.maximum(rough, 5e-4)
    else:
        gain, read = np.asarray(noise.gain, float), np.asarray(noise.read, float)
    values = np.where(used[..., None], values, 0.0)
    return Grid(values=values, used=used, origin_px=origin, step_px=step_px, gain=gain, read=read)


def _smaller(grid: Grid, factor: int) -> Grid:
    """The picture averaged over `factor` x `factor` samples."""
    import cv2

    if factor == 1:
        return grid
    h, w = (n // factor for n in grid.used.shape)
    values = cv2.resize(grid.values[: h * factor, : w * factor], (w, h), interpolation=cv2.INTER_AREA)
    used = cv2.resize(grid.used[: h * factor, : w * factor].astype(np.uint8), (w, h), interpolation=cv2.INTER_NEAREST)
    return Grid(
        values=values,
        used=used > 0,
        origin_px=grid.origin_px + grid.step_px * (factor - 1) / 2,
        step_px=grid.step_px * factor,
        gain=grid.gain / factor**2,
        read=grid.read / factor,
    )


def picture_size(grid: Grid) -> tuple[int, int]:
    """Columns and rows."""
    return grid.used.shape[1], grid.used.shape[0]


def _outline(grid: Grid, coarse: Grid, camera: Camera, shape: Floats, rng: np.random.Generator) -> Outline | None:
    """Refine a coarse circle, first at its own resolution, then at the picture's; None where no limb agrees."""
    search = max(3.0, 0.05 * shape[2] / coarse.step_px)
    last: tuple[Solution, Any] | None = None
    for level, reach in ((coarse, search), (coarse, 2.0), (grid, 4.0), (grid, 2.0), (grid, 1.5)):
        last = _refined(level, camera, shape, search=reach, rng=rng)
        if last is None:
            return None
        if np.abs(last[0].shape - shape).max() > 2 * search * coarse.step_px:
            return None
        shape = last[0].shape
    assert last is not None  # noqa: S101  # the loop ran
    solution, (points, arc) = last
    sphere = Sphere(
        centre_px=(float(shape[0]), float(shape[1])),
        radius_px=float(shape[2]),
        covariance_px2=solution.covariance,
        source="detected",
    )
    reason = _doubt(solution, arc, shape)
    if arc < 0.2:
        return None
    return Outline(
        sphere=sphere, uncertain=bool(reason), reason=reason, arc=arc, scatter_px=solution.excess_px, limb_px=points
    )


def _doubt(solution: Solution, arc: float, shape: Floats) -> str:
    sd = float(np.sqrt(np.diag(solution.covariance).max()))
    if arc < 0.35:
        return f"only {100 * arc:.0f} % of the outline was seen"
    if sd > max(0.005 * shape[2], 0.3):
        return f"its outline is known to {sd:.2f} px only"
    return ""


def _refined(
    grid: Grid, camera: Camera, shape: Floats, *, search: float, rng: np.random.Generator
) -> tuple[Solution, tuple[Floats, float]] | None:
    radius = float(shape[2] / grid.step_px)
    if radius < 5.0:
        return None
    segments = int(np.clip(2 * np.pi * radius / 8.0, 24, 300))
    length = min(9.0, 2 * np.pi * radius / segments)
    profile = profiles(grid, camera, shape, segments=segments, length=length, reach=search + 6.0)
    weighing = Weighing(
        radius=radius, blur=0.7, level=_level(grid, shape), gain=grid.gain, read=np.maximum(grid.read, 1e-6)
    )
    places = edge_places(profile, weighing, search=search)
    good = (places.evidence > 30.0) & (places.sd < 1.0)
    points = profile.place_px - profile.normal * (places.depth * grid.step_px)[:, None]
    solution = solve(camera, shape, points[good], places.sd[good] * grid.step_px, rng=rng)
    if solution is None:
        return None
    used = points[good][solution.agree]
    return solution, (used, len(used) / segments)


def _level(grid: Grid, shape: Floats) -> Floats:
    """The brightness of the ball's lit part, per channel."""
    origin = grid.origin_px.mean(axis=0)
    column, row = (shape[:2] - origin) / grid.step_px
    r = shape[2] / grid.step_px
    x0, x1 = (int(np.clip(v, 0, grid.used.shape[1])) for v in (column - r, column + r + 1))
    y0, y1 = (int(np.clip(v, 0, grid.used.shape[0])) for v in (row - r, row + r + 1))
    step = max(1, int(r / 100))
    box = grid.values[y0:y1:step, x0:x1:step]
    return np.asarray(np.percentile(box, 80, axis=(0, 1))) if box.size else np.ones(grid.values.shape[2])


__all__ = ["Outline", "depth_px", "find_sphere"]
