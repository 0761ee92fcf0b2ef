"""From a million samples to some thousand cells.

A cell is no wider than `SMOOTH_RAD` anywhere, narrower towards the limb, where the surface turns away, and near a
highlight and a terminator no wider than a share of the angle to them. So four nodes predict its mean and slopes: no
bias that matters, and only the little information is lost that curved inside a cell. Cost: one pass over the samples,
whatever the number of lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.sphere import sight_offset, surface
from toolkit.records import Floats, Light, LinearImage, Scene
from toolkit.reflectance.cosines import dots

from .cells import SIDE_X, SIDE_Y, Cells, ChannelCells
from .pyramid import Centroid, Grid, Level, Mask, Rows, grid_of, pyramid

SMOOTH_RAD = 0.16  # widest cell, as the angle its normals span where the surface faces the camera
LIMB_POWER = 1.5  # of n.v, by which cells grow narrower: one for foreshortening, the rest since n itself curves there
SHARPNESS = 1 / 7  # width of a cell over the angle to the highlight's centre
TERMINATOR = 0.5  # width of a cell over the elevation of the light: its cosine has a kink at 0, weights grow towards it
TERMINATOR_RAD = 0.02  # narrower than this the terminator does not matter
MIN_N_DOT_V = 0.2  # nearer the limb than this, a sample's normal is too uncertain to be of use
MIN_N_DOT_L = 0.06  # nearer the terminator, the light's own size shows
LIMB_MARGIN_PX = 2.0  # the camera's blur mixes the background into what lies closer to the outline
DIRECTION_SD_DEG = 1.0  # of a light whose error was not stated
NEARNESS_SD = 0.02  # prior of 1 / distance (per sphere radius) of a light called directional, or error of a point's
STEEPEST = 10.0  # of n.l over a step across the image, in radii, between a usable sample and its block's centre
WARY_SDS = 3.0  # of the calibration, by which limb and terminator may lie elsewhere

HALVES_X, HALVES_Y = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])  # of a block, its four quarters


def gather(image: LinearImage, scene: Scene, *, finest_rad: float = 0.02) -> Cells:
    """Gather the usable samples of a photograph of `scene` into cells.

    `finest_rad` is the smallest angular scale of a lobe that the cells must resolve. Samples that are flagged, in
    shadow or at the limb take no part; clipped ones are cells of their own, which only say "at least so much". Raises
    ValueError where a sample that is not flagged is not a number.
    """
    step = image.planes[0].step_px
    levels = max(int(np.log2(max(SMOOTH_RAD * scene.sphere.radius_px / step, 1.0))), 0)
    grid = grid_of(image.planes, levels)
    row, column = (index.ravel() for index in np.indices([n // 2**levels for n in grid.value.shape[1:]]))
    found, wary = [], _wary(scene)
    for level in reversed(pyramid(grid, levels)):
        here, row, column = _cells_of(grid, level, scene, wary, row, column, finest_rad)
        found.append(here)
        row, column = (2 * row[:, None] + HALVES_Y).ravel(), (2 * column[:, None] + HALVES_X).ravel()
    cells = _cells(grid, *(np.concatenate(part, axis=-1) for part in zip(*found, strict=True)))
    if not all(np.isfinite(data.value).all() for data in cells.channels):
        raise ValueError(f"{image.name} has NaN or infinite samples on the sphere; expected them flagged INVALID")
    return cells


_Found = tuple[Floats, Floats, Floats, Floats, Mask, Mask]  # place x, y, side; means and slopes, good, censored


def _cells_of(
    grid: Grid, level: Level, scene: Scene, wary: _Wary, row: Rows, column: Rows, finest_rad: float
) -> tuple[_Found, Rows, Rows]:
    """Of some blocks those that are cells, and rows and columns of those that are worth dividing."""
    side, last, width = level.side, level.side == 1, level.side * grid.step_px
    x = grid.origin_px[0] + grid.step_px * (column * side + (side - 1) / 2)
    y = grid.origin_px[1] + grid.step_px * (row * side + (side - 1) / 2)
    aside = sight_offset(scene.camera, scene.sphere, x, y)
    across = 0.0 if last else width / scene.sphere.radius_px  # of a block's half diagonal: no more, at any focal length
    lit, allowed = _light_on(scene, wary, x, y, finest_rad, last=last)
    spoiled = level.spoiled(row, column)
    keep, coarse = (aside < wary.furthest) & (lit > 0.0), np.zeros(len(x), bool)
    if not last:
        coarse = (width > allowed) | spoiled.any(axis=0)
        keep &= ~coarse
    worth = coarse & (aside < wary.furthest + across) & (lit > -STEEPEST * across)
    here, divided = np.flatnonzero(keep), np.flatnonzero(worth)
    bound = np.zeros((3, len(here)), bool)
    if last and grid.clipped is not None:
        bound = grid.clipped[:, row[here], column[here]]
    told = level.told(row[here], column[here])
    found = x[here], y[here], np.full(len(here), float(side)), told, ~spoiled[:, here] | bound, bound
    return found, row[divided], column[divided]


def _cells(grid: Grid, x: Floats, y: Floats, side: Floats, data: Floats, good: Mask, censored: Mask) -> Cells:
    """`data` (3, 3, N): of each channel the mean, and the slopes along x and y from one pixel or quad to the next."""
    sets = list(dict.fromkeys(grid.centroids))
    spreads = np.array([_spreads(one, grid.step_px, side) for one in sets])  # (S, 2, N)
    apart = spreads[:, np.where(SIDE_X == SIDE_Y, 0, 1)[:, 0]]
    place_x, place_y = np.array([(one.x_px, one.y_px) for one in sets]).T[:, :, None, None]
    scales, every = [_Scale.of(one, grid.step_px, side) for one in spreads], np.tile(np.arange(len(x)), 3)
    channels = []
    for c, centroid in enumerate(grid.centroids):
        kept, place = np.flatnonzero(good[c]), sets.index(centroid)
        values, counts = _told(data[c], scales[place]), grid.samples[c] * scales[place].counts
        whole = len(kept) == len(x)
        channels.append(
            ChannelCells(
                rows=every if whole else np.tile(kept, 3),
                place=place,
                value=(values if whole else values[:, kept]).ravel(),
                count=(counts if whole else counts[:, kept]).ravel(),
                censored=censored[c, kept],
            )
        )
    return Cells(
        x_px=x,
        y_px=y,
        node_x_px=x + place_x + SIDE_X * apart,
        node_y_px=y + place_y + SIDE_Y * apart,
        channels=(channels[0], channels[1], channels[2]),
    )


def _spreads(centroid: Centroid, step_px: int, side: Floats) -> tuple[Floats, Floats]:
    """How far the nodes on the falling and on the rising diagonal lie from their centre, along x and along y (N,).

    So they share the second moments of the samples' places and of the pixel's own box.
    """
    second = (step_px**2 * (side**2 - 1.0) + 1.0) / 12.0 + centroid.variance_px2
    return np.sqrt(second + centroid.product_px2), np.sqrt(second - centroid.product_px2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Scale:
    """Of one set of nodes, what turns slopes from one pixel or quad to the next into those over the nodes (N,)."""

    same: Floats  # along the same axis
    other: Floats  # along the other one
    counts: Floats  # (3, N), for how many samples of a channel with one a quad the mean and the slopes stand

    @classmethod
    def of(cls, spreads: Floats, step_px: int, side: Floats) -> _Scale:
        share = step_px**2 * (side**2 - 1.0) / 12.0 / np.mean(spreads**2, axis=0)
        return cls(
            same=0.5 * (spreads[0] + spreads[1]) / step_px,
            other=0.5 * (spreads[0] - spreads[1]) / step_px,
            counts=side**2 * np.stack([np.ones(len(side)), share, share]),
        )


def _told(data: Floats, scale: _Scale) -> Floats:
    """Means and slopes (3, N) as the nodes give them."""
    values = np.empty(data.shape)
    values[0], values[1:] = data[0], scale.same * data[1:]
    if scale.other.any():
        values[1:] += scale.other * data[:0:-1]
    return values


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
        dark=tuple(max(MIN_N_DOT_L, WARY_SDS * (_terminator_sd_rad(light) + place)) for light in scene.lights),
    )


def _light_on(
    scene: Scene, wary: _Wary, x: Floats, y: Floats, finest_rad: float, *, last: bool
) -> tuple[Floats, Floats]:
    """At each place the largest n.l by which it is safely lit, and the widest cell allowed there in pixels.

    Of the `last` level, which is not divided any more, the width is not asked for.
    """
    seen, radius = surface(scene.camera, scene.sphere, x, y), scene.sphere.radius_px
    width_rad = np.full(len(x), SMOOTH_RAD)
    lit = np.full(len(x), -1.0)
    for light, dark in zip(scene.lights, wary.dark, strict=True):
        n_dot_l, n_dot_v, l_dot_v = dots(seen.normal, light.at(seen.normal)[0], seen.view)
        lit = np.maximum(lit, n_dot_l - dark)
        if not last:
            both = np.sqrt(np.maximum(2.0 + 2.0 * l_dot_v, 1e-12))
            theta = np.arccos(np.clip((n_dot_l + n_dot_v) / both, -1.0, 1.0))
            width_rad = np.minimum(width_rad, SHARPNESS * np.maximum(theta, finest_rad))
            width_rad = np.minimum(width_rad, TERMINATOR * np.maximum(np.abs(n_dot_l), TERMINATOR_RAD))
    if last:
        return lit, width_rad
    return lit, radius * np.maximum(n_dot_v, MIN_N_DOT_V) ** LIMB_POWER * width_rad


def _place_sd_px(scene: Scene) -> float:
    """Sd of the outline's place where it is largest."""
    covariance = np.asarray(scene.sphere.covariance_px2)
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance[:2, :2])[-1] + covariance[2, 2], 0.0)))


def _terminator_sd_rad(light: Light) -> float:
    """How well it is known where the light's rays graze the sphere: a nearer light is gone sooner."""
    return float(np.hypot(direction_sd_rad(light), NEARNESS_SD))


def direction_sd_rad(light: Light) -> float:
    """How well a light's direction is known, about each of two axes."""
    stated = getattr(light, "direction_sd_deg", None)
    return float(np.radians(DIRECTION_SD_DEG if stated is None else stated))
