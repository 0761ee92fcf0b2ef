"""From a million samples to some ten thousand cells: the data that every fit works on.

A cell is a square block of samples of one plane, small against everything that a lobe does there: no wider than
`SMOOTH_RAD` anywhere, and near a highlight no wider than a sixteenth of the angle to its centre. Its value is the
plain mean of its samples, so nothing of it depends on a model or on weights. A model predicts that mean as its own
mean over four nodes, which have the cell's second moments (the samples' places and the pixel's own box, Gauss's
two-point rule along each axis): the error is of fourth order in the cell's width. Averaging loses no accuracy, only
the little information that varied inside a cell. Cost: one pass over the samples, whatever the number of lights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import surface
from toolkit.records import Floats, LinearImage, Plane, Scene, readonly

SMOOTH_RAD = 0.04  # widest cell, as the angle its normals span
SHARPNESS = 1 / 16  # width of a cell over the angle to the highlight's centre
MIN_N_DOT_V = 0.2  # nearer the limb than this, a sample's normal is too uncertain to be of use
MIN_N_DOT_L = 0.06  # nearer the terminator, the light's own size shows
LIMB_MARGIN_PX = 2.0  # the camera's blur mixes the background into what lies closer to the outline


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChannelCells:
    """The cells that hold samples of one channel: `rows` index the cells' places."""

    rows: NDArray[np.intp]  # (n,)
    value: Floats  # (n,), mean radiance
    count: Floats  # (n,), samples averaged

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Places of the cells (N,) and the three channels' values on them."""

    x_px: Floats  # (N,)
    y_px: Floats  # (N,)
    spread_px: Floats  # (N,), sd of the places inside a cell along each axis, the pixel's box included
    channels: tuple[ChannelCells, ChannelCells, ChannelCells]

    def __post_init__(self) -> None:
        readonly(self)

    def nodes(self) -> tuple[Floats, Floats]:
        """Pixel coordinates x, y of the four nodes of every cell, each (4, N)."""
        dx = np.array([-1.0, 1.0, -1.0, 1.0])[:, None] * self.spread_px
        dy = np.array([-1.0, -1.0, 1.0, 1.0])[:, None] * self.spread_px
        return self.x_px + dx, self.y_px + dy


def gather(image: LinearImage, scene: Scene, *, finest_rad: float = 0.02) -> Cells:
    """Gather the usable samples of a photograph of `scene` into cells.

    `finest_rad` is the smallest angular scale of a lobe that the cells must resolve. Samples that are flagged, in
    shadow or at the limb take no part.
    """
    parts = [_group(planes, scene, finest_rad) for planes in _same_grid(image.planes)]
    x, y, spread = (np.concatenate([part[i] for part in parts]) for i in range(3))
    start = np.cumsum([0] + [len(part[0]) for part in parts])
    channels = []
    for channel in range(3):
        rows, value, count = [], [], []
        for first, (px, _, _, numbers, means, counts) in zip(start, parts, strict=False):
            for i in np.flatnonzero(np.asarray(numbers) == channel):
                good = counts[i] > 0
                rows.append(first + np.arange(len(px))[good])
                value.append(means[i][good])
                count.append(counts[i][good])
        channels.append(
            ChannelCells(
                rows=np.concatenate(rows or [np.zeros(0, np.intp)]),
                value=np.concatenate(value or [np.zeros(0)]),
                count=np.concatenate(count or [np.zeros(0)]),
            )
        )
    return Cells(x_px=x, y_px=y, spread_px=spread, channels=(channels[0], channels[1], channels[2]))


Part = tuple[Floats, Floats, Floats, list[int], list[Floats], list[Floats]]


def _same_grid(planes: tuple[Plane, ...]) -> list[list[Plane]]:
    """Planes that share their places, an RGB image's three, share their cells as well."""
    groups: dict[tuple[object, ...], list[Plane]] = {}
    for plane in planes:
        groups.setdefault((plane.origin_px, plane.step_px, plane.values.shape), []).append(plane)
    return list(groups.values())


def _group(planes: list[Plane], scene: Scene, finest_rad: float) -> Part:
    """Cells of planes on one grid: coarsest blocks first, each kept where it is small and whole, else divided."""
    plane = planes[0]
    step, (x0, y0) = plane.step_px, plane.origin_px
    levels = max(int(np.log2(max(SMOOTH_RAD * scene.sphere.radius_px / step, 1.0))), 0)
    sums, spoiled = _pyramid(planes, levels)
    open_blocks = np.ones(sums[levels].shape[1:], bool)
    found: list[Part] = []
    for level in range(levels, -1, -1):
        row, column = np.nonzero(open_blocks)
        size = 2**level
        x = x0 + step * (column * size + (size - 1) / 2)
        y = y0 + step * (row * size + (size - 1) / 2)
        allowed, usable, hopeless = _allowed_px(scene, x, y, size * step, finest_rad)
        bad = spoiled[level][:, row, column]
        keep = usable if level == 0 else usable & (size * step <= allowed) & ~bad.any(axis=0)
        spread = np.full(keep.sum(), np.sqrt((step**2 * (size**2 - 1) + 1.0) / 12.0))
        means = [total[row[keep], column[keep]] / size**2 for total in sums[level]]
        counts = [np.where(b[keep], 0.0, float(size**2)) for b in bad]
        found.append((x[keep], y[keep], spread, [p.channel for p in planes], means, counts))
        if level:
            divide = ~keep & ~hopeless
            open_blocks = np.zeros(open_blocks.shape, bool)
            open_blocks[row[divide], column[divide]] = True
            open_blocks = open_blocks.repeat(2, axis=0).repeat(2, axis=1)
    join = [np.concatenate([part[i] for part in found]) for i in range(3)]
    means = [np.concatenate([part[4][i] for part in found]).astype(float) for i in range(len(planes))]
    counts = [np.concatenate([part[5][i] for part in found]) for i in range(len(planes))]
    return join[0], join[1], join[2], [p.channel for p in planes], means, counts


def _pyramid(planes: list[Plane], levels: int) -> tuple[list[Floats], list[NDArray[np.bool_]]]:
    """Sums of 1, 2 x 2, 4 x 4 ... samples (C, h, w), and whether any of them is flagged; padded by flagged samples."""
    size = 2**levels
    height, width = planes[0].values.shape
    pad = ((0, -height % size), (0, -width % size))
    total = np.stack([np.pad(np.where(p.flags == 0, p.values, 0.0), pad) for p in planes])
    bad = np.stack([np.pad(p.flags != 0, pad, constant_values=True) for p in planes])
    sums, spoiled = [total], [bad]
    for _ in range(levels):
        total = total[:, ::2] + total[:, 1::2]
        total = total[..., ::2] + total[..., 1::2]
        bad = bad[:, ::2] | bad[:, 1::2]
        bad = bad[..., ::2] | bad[..., 1::2]
        sums.append(total)
        spoiled.append(bad)
    return sums, spoiled


def _allowed_px(
    scene: Scene, x: Floats, y: Floats, width_px: float, finest_rad: float
) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """Widest cell allowed at each place, whether samples there are usable, and whether none in the block can be."""
    seen = surface(scene.camera, scene.sphere, x, y)
    n_dot_v = np.einsum("ni,ni->n", seen.normal, seen.view)
    width_rad = np.full(len(x), SMOOTH_RAD)
    lit = np.full(len(x), -1.0)
    for light in scene.lights:
        towards, _ = light.at(seen.normal)
        half = towards + seen.view
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        theta = np.arccos(np.clip(np.einsum("ni,ni->n", seen.normal, half), -1.0, 1.0))
        width_rad = np.minimum(width_rad, SHARPNESS * np.maximum(theta, finest_rad))
        lit = np.maximum(lit, np.einsum("ni,ni->n", seen.normal, towards))
    radius = scene.sphere.radius_px
    rim = (1.0 - np.sqrt(np.maximum(1.0 - n_dot_v**2, 0.0))) * radius  # px inside the outline
    usable = seen.on_sphere & (n_dot_v > MIN_N_DOT_V) & (rim > LIMB_MARGIN_PX) & (lit > MIN_N_DOT_L)
    beyond = np.hypot(x - scene.sphere.centre_px[0], y - scene.sphere.centre_px[1]) - radius
    slack = width_px / radius
    ellipse = 0.0 if scene.camera.projection == "orthographic" else 0.3 * radius  # how far an outline may bulge
    hopeless = ((beyond > width_px + ellipse) & ~seen.on_sphere) | (lit < -0.05 - 4 * slack)
    return radius * n_dot_v * width_rad, usable, hopeless
