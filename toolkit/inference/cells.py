"""From a million samples to some ten thousand cells: the data that every fit works on.

A cell is a square block of samples, small against everything that a lobe does there: no wider than `SMOOTH_RAD`
anywhere, and near a highlight no wider than an eighth of the angle to its centre. Its value is the plain mean of its
samples, so nothing of it depends on a model or on weights. A model predicts that mean as a weighted mean over four
nodes, which share the samples' first and second moments (their places and the pixel's own box; Gauss's two-point rule
along each axis). Averaging adds no bias that matters, and loses only the little information that varied inside a cell.
The four planes of a mosaic share their cells: a channel's place in the 2 x 2 quad is in its nodes' weights.
Cost: one pass over the samples, whatever the number of lights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import sight_offset, surface
from toolkit.records import Floats, Light, LinearImage, Scene, readonly

from .pyramid import Grid, Level, Mask, Rows, grid_of, pyramid

SMOOTH_RAD = 0.08  # widest cell, as the angle its normals span
SHARPNESS = 1 / 8  # width of a cell over the angle to the highlight's centre
MIN_N_DOT_V = 0.2  # nearer the limb than this, a sample's normal is too uncertain to be of use
MIN_N_DOT_L = 0.06  # nearer the terminator, the light's own size shows
LIMB_MARGIN_PX = 2.0  # the camera's blur mixes the background into what lies closer to the outline
DIRECTION_SD_DEG = 1.0  # of a light whose error was not stated
STEEPEST = 10.0  # of n.l over a step across the image, in radii, between a usable sample and its block's centre
WARY_SDS = 3.0  # of the calibration, by which limb and terminator may lie elsewhere

SIDE_X = np.array([-1.0, 1.0, -1.0, 1.0])[:, None]  # the nodes' places about a cell's centre, in spreads
SIDE_Y = np.array([-1.0, -1.0, 1.0, 1.0])[:, None]
HALVES_X, HALVES_Y = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])  # of a block, its four quarters


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelCells:
    """The cells that hold samples of one channel: `rows` index the cells' places."""

    rows: NDArray[np.intp]  # (n,)
    value: Floats  # (n,), mean radiance
    count: Floats  # (n,), samples averaged
    weights: Floats  # (4, n), of the nodes, summing to 1
    censored: NDArray[np.bool_]  # (n,), clipped: the radiance is at least the value

    def __post_init__(self) -> None:
        readonly(self)

    def mean(self, nodes: Floats) -> Floats:
        """Means over the cells (..., n) of what has the values `nodes` (..., 4, N) at the nodes of all places."""
        if any(self.weights.strides):
            here = nodes if len(self.rows) == nodes.shape[-1] else nodes[..., self.rows]
            return np.asarray(np.einsum("kn,...kn->...n", self.weights, here))
        total = nodes[..., 0, :] + nodes[..., 1, :]
        total += nodes[..., 2, :]
        total += nodes[..., 3, :]
        total *= self.weights.flat[0]
        return total if len(self.rows) == nodes.shape[-1] else np.asarray(total[..., self.rows])

    @property
    def sharing(self) -> tuple[int, int]:
        """The same for channels that are averaged over the same nodes in the same way."""
        return id(self.rows), id(self.weights) if any(self.weights.strides) else 0

    def picked(self, there: NDArray[np.bool_], rows: NDArray[np.intp]) -> ChannelCells:
        """Some of the cells, at new places."""
        return ChannelCells(
            rows=rows,
            value=self.value[there],
            count=self.count[there],
            weights=self.weights[:, there] if any(self.weights.strides) else self.weights[:, : len(rows)],
            censored=self.censored[there],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Places of the cells (N,) and the three channels' values on them."""

    x_px: Floats  # (N,)
    y_px: Floats  # (N,)
    spread_px: Floats  # (N,), of the nodes about the centre along each axis
    channels: tuple[ChannelCells, ChannelCells, ChannelCells]

    def __post_init__(self) -> None:
        readonly(self)

    def nodes(self) -> tuple[Floats, Floats]:
        """Pixel coordinates x, y of the four nodes of every cell, each (4, N)."""
        return self.x_px + SIDE_X * self.spread_px, self.y_px + SIDE_Y * self.spread_px

    def thinned(self, every: int) -> Cells:
        """One cell in `every`, for a first search."""
        kept = np.arange(0, len(self.x_px), every)
        place = np.full(len(self.x_px), -1)
        place[kept] = np.arange(len(kept))
        red, green, blue = self._sharing(
            [data.picked(place[data.rows] >= 0, place[data.rows][place[data.rows] >= 0]) for data in self.channels]
        )
        return Cells(
            x_px=self.x_px[kept],
            y_px=self.y_px[kept],
            spread_px=self.spread_px[kept],
            channels=(red, green, blue),
        )

    def _sharing(self, picked: list[ChannelCells]) -> list[ChannelCells]:
        """Channels that shared their places and weights share those that were picked."""
        return [
            replace(data, rows=picked[0].rows, weights=picked[0].weights)
            if mine.sharing == self.channels[0].sharing
            else data
            for mine, data in zip(self.channels, picked, strict=True)
        ]


def gather(image: LinearImage, scene: Scene, *, finest_rad: float = 0.02) -> Cells:
    """Gather the usable samples of a photograph of `scene` into cells.

    `finest_rad` is the smallest angular scale of a lobe that the cells must resolve. Samples that are flagged, in
    shadow or at the limb take no part; clipped ones are cells of their own, which only say "at least so much".
    """
    step = image.planes[0].step_px
    levels = max(int(np.log2(max(SMOOTH_RAD * scene.sphere.radius_px / step, 1.0))), 0)
    grid = grid_of(image.planes, levels)
    row, column = (index.ravel() for index in np.indices([n // 2**levels for n in grid.value.shape[1:]]))
    found, wary = [], _wary(scene)
    for level in reversed(pyramid(grid, levels)):
        cells, row, column = _cells_of(grid, level, scene, wary, row, column, finest_rad)
        found.append(cells)
        row, column = (2 * row[:, None] + HALVES_Y).ravel(), (2 * column[:, None] + HALVES_X).ravel()
    return _cells(grid, *(np.concatenate(part, axis=-1) for part in zip(*found, strict=True)))


_Found = tuple[Floats, Floats, Floats, Floats, Mask, Mask]  # place x, y, side, means, good, censored


def _cells_of(
    grid: Grid, level: Level, scene: Scene, wary: _Wary, row: Rows, column: Rows, finest_rad: float
) -> tuple[_Found, Rows, Rows]:
    """Of some blocks those that are cells, and rows and columns of those that are worth dividing."""
    side, last, width = level.side, level.side == 1, level.side * grid.step_px
    x = grid.origin_px[0] + grid.step_px * (column * side + (side - 1) / 2)
    y = grid.origin_px[1] + grid.step_px * (row * side + (side - 1) / 2)
    aside = sight_offset(scene.camera, scene.sphere, x, y)
    across = 0.0 if last else width / scene.sphere.radius_px  # of a block's half diagonal: no more, at any focal length
    near = np.flatnonzero(aside < wary.furthest + across)
    x, y, row, column, aside = x[near], y[near], row[near], column[near], aside[near]
    lit, allowed = _light_on(scene, wary, x, y, finest_rad, last=last)
    bad = level.spoiled(row, column)
    keep = (aside < wary.furthest) & (lit > 0.0)
    if not last:
        keep &= (width <= allowed) & ~bad.any(axis=0)
    here, divided = np.flatnonzero(keep), np.flatnonzero(~keep & (lit > -STEEPEST * across))
    bound = np.zeros((3, len(here)), bool)
    if last and grid.clipped is not None:
        bound = grid.clipped[:, row[here], column[here]]
    means = level.means(row[here], column[here])
    found = x[here], y[here], np.full(len(here), float(side)), means, ~bad[:, here] | bound, bound
    return found, row[divided], column[divided]


def _cells(grid: Grid, x: Floats, y: Floats, size: Floats, means: Floats, good: Mask, censored: Mask) -> Cells:
    within = ((grid.step_px - 1) / 2) ** 2  # second moment of a channel's samples about the quad's centre
    spread = np.sqrt((grid.step_px**2 * (size**2 - 1) + 1.0) / 12.0 + within)
    everywhere, even = np.arange(len(x)), np.broadcast_to(0.25, (4, len(x)))
    rows = [everywhere if good[c].all() else np.flatnonzero(good[c]) for c in range(3)]
    channels = [
        ChannelCells(
            rows=rows[c],
            value=means[c, rows[c]].astype(float),
            count=grid.samples[c] * size[rows[c]] ** 2,
            weights=_node_weights(grid.first[c], spread[rows[c]]) if grid.first[c].any() else even[:, : len(rows[c])],
            censored=censored[c, rows[c]],
        )
        for c in range(3)
    ]
    return Cells(x_px=x, y_px=y, spread_px=spread, channels=(channels[0], channels[1], channels[2]))


def _node_weights(first: Floats, spread: Floats) -> Floats:
    """Of the four nodes (4, n), so that they share a channel's mean place and mean product of places."""
    sx, sy, sxy = (float(moment) for moment in first)
    return np.asarray(
        0.25 * (1.0 + SIDE_X * (sx / spread) + SIDE_Y * (sy / spread) + SIDE_X * SIDE_Y * (sxy / spread**2))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wary:
    """Where samples are usable by what is known of the calibration."""

    furthest: float  # from the sphere's centre, in radii, that their lines of sight pass
    dark: tuple[float, ...]  # the n.l of each light that they must exceed


def _wary(scene: Scene) -> _Wary:
    place = _place_sd_px(scene) / scene.sphere.radius_px
    rim = 1.0 - LIMB_MARGIN_PX / scene.sphere.radius_px - WARY_SDS * place
    return _Wary(
        furthest=float(min(rim, np.sqrt(1.0 - MIN_N_DOT_V**2))),
        dark=tuple(max(MIN_N_DOT_L, WARY_SDS * (direction_sd_rad(light) + place)) for light in scene.lights),
    )


def _light_on(
    scene: Scene, wary: _Wary, x: Floats, y: Floats, finest_rad: float, *, last: bool
) -> tuple[Floats, Floats]:
    """At each place the largest n.l by which it is safely lit, and the widest cell allowed there in pixels.

    Of the `last` level, which is not divided any more, the width is not asked for.
    """
    seen, radius = surface(scene.camera, scene.sphere, x, y), scene.sphere.radius_px
    n_dot_v = _dot(seen.normal, seen.view)
    width_rad = np.full(len(x), SMOOTH_RAD)
    lit = np.full(len(x), -1.0)
    for light, dark in zip(scene.lights, wary.dark, strict=True):
        towards, _ = light.at(seen.normal)
        n_dot_l = _dot(seen.normal, towards)
        lit = np.maximum(lit, n_dot_l - dark)
        if not last:
            both = np.sqrt(np.maximum(2.0 + 2.0 * _dot(towards, seen.view), 1e-12))
            theta = np.arccos(np.clip((n_dot_l + n_dot_v) / both, -1.0, 1.0))
            width_rad = np.minimum(width_rad, SHARPNESS * np.maximum(theta, finest_rad))
    return lit, radius * n_dot_v * width_rad


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def _place_sd_px(scene: Scene) -> float:
    """Sd of the outline's place where it is largest."""
    covariance = np.asarray(scene.sphere.covariance_px2)
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance[:2, :2])[-1] + covariance[2, 2], 0.0)))


def direction_sd_rad(light: Light) -> float:
    """How well a light's direction is known, about each of two axes."""
    stated = getattr(light, "direction_sd_deg", None)
    return float(np.radians(DIRECTION_SD_DEG if stated is None else stated))
