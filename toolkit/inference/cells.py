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

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag
from toolkit.geometry.sphere import surface
from toolkit.records import Floats, Light, LinearImage, Plane, Scene, readonly

SMOOTH_RAD = 0.08  # widest cell, as the angle its normals span
SHARPNESS = 1 / 8  # width of a cell over the angle to the highlight's centre
MIN_N_DOT_V = 0.2  # nearer the limb than this, a sample's normal is too uncertain to be of use
MIN_N_DOT_L = 0.06  # nearer the terminator, the light's own size shows
LIMB_MARGIN_PX = 2.0  # the camera's blur mixes the background into what lies closer to the outline
DIRECTION_SD_DEG = 1.0  # of a light whose error was not stated
WARY_SDS = 3.0  # of the calibration, by which limb and terminator may lie elsewhere

SIDE_X = np.array([-1.0, 1.0, -1.0, 1.0])[:, None]  # the nodes' places about a cell's centre, in spreads
SIDE_Y = np.array([-1.0, -1.0, 1.0, 1.0])[:, None]


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

    def picked(self, there: NDArray[np.bool_], rows: NDArray[np.intp]) -> ChannelCells:
        """Some of the cells, at new places."""
        return ChannelCells(
            rows=rows,
            value=self.value[there],
            count=self.count[there],
            weights=self.weights[:, there],
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
        red, green, blue = (
            data.picked(place[data.rows] >= 0, place[data.rows][place[data.rows] >= 0]) for data in self.channels
        )
        return Cells(
            x_px=self.x_px[kept],
            y_px=self.y_px[kept],
            spread_px=self.spread_px[kept],
            channels=(red, green, blue),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grid:
    """The image's samples as one grid of pixels or quads: per channel the mean value, and whether any is flagged."""

    value: Floats  # (3, h, w)
    bad: NDArray[np.bool_]  # (3, h, w)
    clipped: NDArray[np.bool_]  # (3, h, w), of the bad ones those that are so only by being clipped
    samples: tuple[int, int, int]  # of each channel in one pixel or quad
    first: tuple[Floats, Floats, Floats]  # per channel, mean place x, y about the centre, and mean of x y
    origin_px: tuple[float, float]
    step_px: int


def gather(image: LinearImage, scene: Scene, *, finest_rad: float = 0.02) -> Cells:
    """Gather the usable samples of a photograph of `scene` into cells.

    `finest_rad` is the smallest angular scale of a lobe that the cells must resolve. Samples that are flagged, in
    shadow or at the limb take no part; clipped ones are cells of their own, which only say "at least so much".
    """
    grid = _grid(image.planes)
    levels = max(int(np.log2(max(SMOOTH_RAD * scene.sphere.radius_px / grid.step_px, 1.0))), 0)
    sums, spoiled = _pyramid(grid, levels)
    grid_clipped = _padded(grid.clipped, levels, fill=False)
    open_blocks = np.ones(sums[levels].shape[1:], bool)
    x, y, size, means, good, censored = [], [], [], [], [], []
    for level in range(levels, -1, -1):
        row, column = np.nonzero(open_blocks)
        side = 2**level
        bx = grid.origin_px[0] + grid.step_px * (column * side + (side - 1) / 2)
        by = grid.origin_px[1] + grid.step_px * (row * side + (side - 1) / 2)
        allowed, usable, hopeless = _allowed_px(scene, bx, by, side * grid.step_px, finest_rad)
        bad = spoiled[level][:, row, column]
        keep = usable if level == 0 else usable & (side * grid.step_px <= allowed) & ~bad.any(axis=0)
        x.append(bx[keep])
        y.append(by[keep])
        size.append(np.full(int(keep.sum()), float(side)))
        means.append(sums[level][:, row[keep], column[keep]] / side**2)
        bound = grid_clipped[:, row, column] if level == 0 else np.zeros(bad.shape, bool)
        good.append(~bad[:, keep] | bound[:, keep])
        censored.append(bound[:, keep])
        if level:
            divide = ~keep & ~hopeless
            open_blocks = np.zeros(open_blocks.shape, bool)
            open_blocks[row[divide], column[divide]] = True
            open_blocks = open_blocks.repeat(2, axis=0).repeat(2, axis=1)
    return _cells(grid, *(np.concatenate(part, axis=-1) for part in (x, y, size, means, good, censored)))


def _cells(
    grid: _Grid,
    x: Floats,
    y: Floats,
    size: Floats,
    means: Floats,
    good: NDArray[np.bool_],
    censored: NDArray[np.bool_],
) -> Cells:
    within = ((grid.step_px - 1) / 2) ** 2  # second moment of a channel's samples about the quad's centre
    spread = np.sqrt((grid.step_px**2 * (size**2 - 1) + 1.0) / 12.0 + within)
    channels = []
    for c in range(3):
        rows = np.flatnonzero(good[c])
        sx, sy, sxy = grid.first[c]
        s = spread[rows]
        weights = 0.25 * (1.0 + SIDE_X * sx / s + SIDE_Y * sy / s + SIDE_X * SIDE_Y * sxy / s**2)
        count = grid.samples[c] * size[rows] ** 2
        channels.append(
            ChannelCells(
                rows=rows,
                value=means[c, rows].astype(float),
                count=count,
                weights=weights,
                censored=censored[c, rows],
            )
        )
    return Cells(x_px=x, y_px=y, spread_px=spread, channels=(channels[0], channels[1], channels[2]))


def _grid(planes: tuple[Plane, ...]) -> _Grid:
    """One grid of all planes: an RGB image's pixels, or a mosaic's quads."""
    height = min(plane.values.shape[0] for plane in planes)
    width = min(plane.values.shape[1] for plane in planes)
    step = planes[0].step_px
    corner = np.min([plane.origin_px for plane in planes], axis=0)
    centre = corner + (step - 1) / 2
    value = np.zeros((3, height, width), np.float32)
    bad, clipped = np.zeros((3, height, width), bool), np.zeros((3, height, width), bool)
    invalid, samples, first = np.zeros((3, height, width), bool), [], []
    for c in range(3):
        mine = [plane for plane in planes if plane.channel == c]
        for plane in mine:
            flags = plane.flags[:height, :width]
            value[c] += plane.values[:height, :width] / np.float32(len(mine))
            bad[c] |= flags != 0
            clipped[c] |= (flags & SampleFlag.CLIPPED) > 0
            invalid[c] |= (flags & SampleFlag.INVALID) > 0
        x, y = (np.array([plane.origin_px for plane in mine]) - centre).T
        samples.append(len(mine))
        first.append(np.array([x.mean(), y.mean(), (x * y).mean()]))
    return _Grid(
        value=value,
        bad=bad,
        clipped=clipped & ~invalid,
        samples=(samples[0], samples[1], samples[2]),
        first=(first[0], first[1], first[2]),
        origin_px=(float(centre[0]), float(centre[1])),
        step_px=step,
    )


def _pyramid(grid: _Grid, levels: int) -> tuple[list[Floats], list[NDArray[np.bool_]]]:
    """Sums of 1, 2 x 2, 4 x 4 ... pixels (3, h, w), and whether any of them is flagged; padded by flagged ones."""
    total: Floats = _padded(grid.value, levels, fill=0.0)
    bad = _padded(grid.bad, levels, fill=True)
    sums, spoiled = [total], [bad]
    for _ in range(levels):
        total = total[:, ::2] + total[:, 1::2]
        total = total[..., ::2] + total[..., 1::2]
        bad = bad[:, ::2] | bad[:, 1::2]
        bad = bad[..., ::2] | bad[..., 1::2]
        sums.append(total)
        spoiled.append(bad)
    return sums, spoiled


def _padded(table: NDArray[Any], levels: int, *, fill: float) -> NDArray[Any]:
    """The table (3, h, w) with sides that the coarsest blocks fill."""
    block, (height, width) = 2**levels, table.shape[1:]
    return np.pad(table, ((0, 0), (0, -height % block), (0, -width % block)), constant_values=fill)


def _allowed_px(
    scene: Scene, x: Floats, y: Floats, width_px: float, finest_rad: float
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Widest cell allowed at each place, whether samples there are usable, and whether none in the block can be."""
    seen = surface(scene.camera, scene.sphere, x, y)
    n_dot_v = np.einsum("ni,ni->n", seen.normal, seen.view)
    width_rad = np.full(len(x), SMOOTH_RAD)
    lit, place_px, radius = np.full(len(x), -1.0), _place_sd_px(scene), scene.sphere.radius_px
    for light in scene.lights:
        towards, _ = light.at(seen.normal)
        half = towards + seen.view
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        theta = np.arccos(np.clip(np.einsum("ni,ni->n", seen.normal, half), -1.0, 1.0))
        width_rad = np.minimum(width_rad, SHARPNESS * np.maximum(theta, finest_rad))
        dark = max(MIN_N_DOT_L, WARY_SDS * (direction_sd_rad(light) + place_px / radius))
        lit = np.maximum(lit, np.einsum("ni,ni->n", seen.normal, towards) - dark)
    rim = (1.0 - np.sqrt(np.maximum(1.0 - n_dot_v**2, 0.0))) * radius  # px inside the outline
    usable = seen.on_sphere & (n_dot_v > MIN_N_DOT_V) & (rim > LIMB_MARGIN_PX + WARY_SDS * place_px) & (lit > 0.0)
    beyond = np.hypot(x - scene.sphere.centre_px[0], y - scene.sphere.centre_px[1]) - radius
    slack = width_px / radius
    ellipse = 0.0 if scene.camera.projection == "orthographic" else 0.3 * radius  # how far an outline may bulge
    hopeless = ((beyond > width_px + ellipse) & ~seen.on_sphere) | (lit < -0.05 - MIN_N_DOT_L - 4 * slack)
    return radius * n_dot_v * width_rad, usable, hopeless


def _place_sd_px(scene: Scene) -> float:
    """Sd of the outline's place where it is largest."""
    covariance = np.asarray(scene.sphere.covariance_px2)
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance[:2, :2])[-1] + covariance[2, 2], 0.0)))


def direction_sd_rad(light: Light) -> float:
    """How well a light's direction is known, about each of two axes."""
    stated = getattr(light, "direction_sd_deg", None)
    return float(np.radians(DIRECTION_SD_DEG if stated is None else stated))
