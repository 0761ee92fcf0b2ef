"""From a million samples to some thousand cells.

A cell is no wider than `SMOOTH_RAD` anywhere, narrower towards the limb, where the surface turns away, and near a
highlight and a terminator no wider than a share of the angle to them. So four nodes predict its mean and slopes: no
bias that matters, and only the little information is lost that curved inside a cell. Cost: one pass over the samples,
whatever the number of lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Light, LinearImage, Scene
from toolkit.reflectance.cosines import dots

from .cells import SIDE_X, SIDE_Y, Cells, ChannelCells
from .pyramid import Blocks, Centroid, Grid, Level, Mask, grid_of, pyramid

SMOOTH_RAD = 0.16  # widest cell, as the angle its normals span where the surface faces the camera
LIMB_POWER = 1.5  # of n.v, by which cells grow narrower: one for foreshortening, the rest since n itself curves there
SHARPNESS = 1 / 7  # width of a cell over the angle to the highlight's centre
TERMINATOR = 0.5  # width of a cell over the elevation of the light: its cosine has a kink at 0, weights grow towards it
WIDEST_RAD = 0.11  # that all of these allow together anywhere on a lit sphere: 0.1091, under a light 55 degrees aside
TERMINATOR_RAD = 0.02  # narrower than this the terminator does not matter
MIN_N_DOT_V = 0.2  # nearer the limb than this, a sample's normal is too uncertain to be of use
MIN_N_DOT_L = 0.06  # nearer the terminator, the light's own size shows
LIMB_MARGIN_PX = 2.0  # the camera's blur mixes the background into what lies closer to the outline
DIRECTION_SD_DEG = 1.0  # of a light whose error was not stated
NEARNESS_SD = 0.02  # prior of 1 / distance (per sphere radius) of a light called directional, or error of a point's
STEEPEST = 10.0  # of n.l over a step across the image, in radii, between a usable sample and its block's centre
WARY_SDS = 3.0  # of the calibration, by which limb and terminator may lie elsewhere

QUARTERS = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])  # of a block, rows and columns


def gather(image: LinearImage, scene: Scene, *, finest_rad: float = 0.02) -> Cells:
    """Gather the usable samples of a photograph of `scene` into cells.

    `finest_rad` is the smallest angular scale of a lobe that the cells must resolve. Samples that are flagged, in
    shadow or at the limb take no part; clipped ones are cells of their own, which only say "at least so much". Raises
    ValueError where a sample that is not flagged is not a number.
    """
    step = image.planes[0].step_px
    levels = max(int(np.log2(max(WIDEST_RAD * scene.sphere.radius_px / step, 1.0))), 0)
    grid = grid_of(image.planes, levels)
    blocks = np.indices([-(-n // 2**levels) for n in grid.size]).reshape(2, -1)
    found, wary = [], _wary(scene)
    for level in reversed(pyramid(grid, levels)):
        here, divided = _cells_of(grid, level, scene, wary, blocks, finest_rad)
        found.append(here)
        blocks = (2 * divided[:, None] + QUARTERS[..., None]).reshape(2, -1)
    cells = _cells(grid, found)
    if not all(np.isfinite(data.value).all() for data in cells.channels):
        raise ValueError(f"{image.name} has NaN or infinite samples on the sphere; expected them flagged INVALID")
    return cells


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """The n cells of one size."""

    side: int
    places: Floats  # (2, n), x and y in pixels
    moments: Floats  # (3, 3, n), as by `Level.moments`
    good: Mask  # (3, n), where each channel is told of; (1, n) if alike in all
    censored: Mask  # the same, of those the clipped ones


def _cells_of(
    grid: Grid, level: Level, scene: Scene, wary: _Wary, blocks: Blocks, finest_rad: float
) -> tuple[_Found, Blocks]:
    """Of some blocks those that are cells, and those that are worth dividing."""
    last, width = level.side == 1, level.side * grid.step_px
    first = np.array(grid.origin_px) + 0.5 * (width - grid.step_px)
    places = width * blocks[::-1] + first[:, None]
    seen, good, bound = surface(scene.camera, scene.sphere, *places), ~level.spoiled(blocks), None
    if last and grid.clipped is not None:
        bound = grid.clipped[:, *blocks]
        good |= bound
    lit, allowed = _light_on(scene, wary, seen, finest_rad, last=last)
    keep, worth = (seen.offset2 < wary.furthest**2) & (lit > 0.0), np.zeros(len(lit), bool)
    if last:
        keep &= good.any(axis=0)
    else:
        coarse = (width > allowed) | ~good.all(axis=0)
        keep &= ~coarse
        across = width / scene.sphere.radius_px  # of a block's half diagonal: no more, at any focal length
        worth = coarse & (seen.offset2 < (wary.furthest + across) ** 2) & (lit > -STEEPEST * across)
    here = np.flatnonzero(keep)
    found = _Found(
        side=level.side,
        places=places.take(here, axis=1),
        moments=level.moments(blocks.take(here, axis=1)),
        good=good.take(here, axis=1),
        censored=np.zeros((len(good), len(here)), bool) if bound is None else bound.take(here, axis=1),
    )
    return found, blocks.take(np.flatnonzero(worth), axis=1)


def _cells(grid: Grid, found: list[_Found]) -> Cells:
    """All of them, the largest first. What depends on a cell's size alone is worked out once a size."""
    sizes, side = [one.places.shape[1] for one in found], np.array([float(one.side) for one in found])
    sets = list(dict.fromkeys(grid.centroids))
    shares = [_Share.of(one, grid.step_px, side) for one in sets]
    x, y = np.concatenate([one.places for one in found], axis=1)
    good, censored = (
        np.broadcast_to(np.concatenate(part, axis=1), (3, len(x)))
        for part in zip(*((f.good, f.censored) for f in found), strict=True)
    )
    places = [sets.index(one) for one in grid.centroids]
    turns = np.array([shares[place].turn for place in places]).swapaxes(0, 1)
    data = np.concatenate([turn @ one.moments for turn, one in zip(turns, found, strict=True)], axis=-1)
    told = {
        (number, place): np.repeat(number * shares[place].counts, sizes, axis=1)
        for number, place in zip(grid.samples, places, strict=True)
    }
    every, channels = np.tile(np.arange(len(x)), 3), []
    for c, place in enumerate(places):
        values, counts, bound, rows = data[c], told[grid.samples[c], place], censored[c], every
        if not good[c].all():
            kept = np.flatnonzero(good[c])
            values, counts, bound, rows = values[:, kept], counts[:, kept], bound[kept], np.tile(kept, 3)
        channels.append(
            ChannelCells(rows=rows, place=place, value=values.ravel(), count=counts.ravel(), censored=bound)
        )
    return Cells(
        x_px=x,
        y_px=y,
        node_x_px=x + np.repeat([one.node_x_px for one in shares], sizes, axis=-1),
        node_y_px=y + np.repeat([one.node_y_px for one in shares], sizes, axis=-1),
        channels=(channels[0], channels[1], channels[2]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Share:
    """What cells of L sizes have in common, for one set of nodes."""

    node_x_px: Floats  # (4, L), the nodes' places about the cell's own
    node_y_px: Floats
    turn: Floats  # (L, 3, 3), from a cell's moments to its mean and its slopes over the nodes
    counts: Floats  # (3, L), for how many samples of a channel with one a quad the mean and the slopes stand

    @classmethod
    def of(cls, centroid: Centroid, step_px: int, side: Floats) -> _Share:
        """The nodes share the second moments of the samples' places and of the pixel's own box.

        They spread otherwise along the falling and the rising diagonal where the places of a quad's samples do.
        """
        within = step_px**2 * (side**2 - 1.0) / 12.0
        second = within + 1.0 / 12.0 + centroid.variance_px2
        falling, rising = np.sqrt(second + centroid.product_px2), np.sqrt(second - centroid.product_px2)
        apart = np.where(SIDE_X == SIDE_Y, falling, rising)
        slope = 12.0 / (side**2 * np.maximum(side**2 - 1.0, 1.0)) / step_px  # from a moment to the plane's, a pixel
        turn = np.zeros((len(side), 3, 3))
        turn[:, 0, 0] = 1.0 / side**2
        turn[:, 1, 1] = turn[:, 2, 2] = 0.5 * (falling + rising) * slope
        turn[:, 1, 2] = turn[:, 2, 1] = 0.5 * (falling - rising) * slope
        share = within / second
        return cls(
            node_x_px=centroid.x_px + SIDE_X * apart,
            node_y_px=centroid.y_px + SIDE_Y * apart,
            turn=turn,
            counts=side**2 * np.stack([np.ones(len(side)), share, share]),
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
        furthest=float(np.clip(rim, 0.0, np.sqrt(1.0 - MIN_N_DOT_V**2))),
        dark=tuple(max(MIN_N_DOT_L, WARY_SDS * (_terminator_sd_rad(light) + place)) for light in scene.lights),
    )


def _light_on(scene: Scene, wary: _Wary, seen: Surface, finest_rad: float, *, last: bool) -> tuple[Floats, Floats]:
    """At each place the largest n.l by which it is safely lit, and the widest cell allowed there in pixels.

    Of the `last` level, which is not divided any more, the width is not asked for.
    """
    lit, width_rad = np.array([-1.0]), np.array([SMOOTH_RAD])
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
    return lit, scene.sphere.radius_px * np.maximum(n_dot_v, MIN_N_DOT_V) ** LIMB_POWER * width_rad


def _place_sd_px(scene: Scene) -> float:
    """Sd of the outline's place where it is largest."""
    (xx, xy, _), (_, yy, _), (_, _, radius2) = np.asarray(scene.sphere.covariance_px2)
    widest2 = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)  # the larger eigenvalue
    return float(np.sqrt(max(widest2 + radius2, 0.0)))


def _terminator_sd_rad(light: Light) -> float:
    """How well it is known where the light's rays graze the sphere: a nearer light is gone sooner."""
    return float(np.hypot(direction_sd_rad(light), NEARNESS_SD))


def direction_sd_rad(light: Light) -> float:
    """How well a light's direction is known, about each of two axes."""
    stated = getattr(light, "direction_sd_deg", None)
    return float(np.radians(DIRECTION_SD_DEG if stated is None else stated))
