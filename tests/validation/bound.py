"""The Cramér-Rao bound of a ball's photograph by differences of the renderer, sample by sample.

It shares neither cells nor columns nor derivatives with a fit, or with the bound that `plan` and `validate` state: only
the lobes, and which samples count. Black level and calibration are known beforehand by their priors (van Trees 1968).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from synthetic.materials import Material, material
from synthetic.render import render
from toolkit.geometry.sphere import surface
from toolkit.inference.expected import MOSAIC
from toolkit.inference.gather import _wary
from toolkit.inference.nuisances import Shifts, shifted
from toolkit.records import Floats, Noise, Scene

SHAPE_STEP, SHIFT_STEP = 1e-2, 0.3  # relative; of a shift's prior sd


def bound_sds(
    scene: Scene, made: Material, noise: Noise, shifts: Shifts, *, side_px: int, pedestal_sd: float
) -> dict[str, Floats]:
    """Smallest sd of every shape number (1,) and colour (3,), by name, from a mosaic of `side_px` squared."""
    values = {**made.shape, **made.colours}
    unknowns = [(name, c) for name, value in values.items() for c in range(np.size(value))]
    prior = np.zeros((len(unknowns) + len(shifts.names) + 3,) * 2)
    extras = slice(len(unknowns), len(prior) - 3)
    prior[extras, extras] = shifts.precision
    prior[np.arange(len(prior) - 3, len(prior)), np.arange(len(prior) - 3, len(prior))] = pedestal_sd**-2
    picture = _picture(scene, made, side_px)
    slopes = np.stack([*_slopes(scene, made, shifts, side_px, unknowns)], axis=-1)
    information, inside = prior, _usable(scene, side_px)
    for row, column, channel in MOSAIC:
        signal = picture[row::2, column::2, channel][inside]
        black = np.eye(3)[channel] * np.ones((len(signal), 1))
        jacobian = np.hstack([slopes[row::2, column::2, channel][inside], black])
        information = information + jacobian.T @ (jacobian / noise.variance(signal, channel)[:, None])
    scale = 1.0 / np.sqrt(np.diag(information))
    sd = scale * np.sqrt(np.diag(np.linalg.inv(information * scale * scale[:, None])))
    return {name: np.array([s for s, (n, _) in zip(sd, unknowns, strict=False) if n == name]) for name in values}


def _slopes(
    scene: Scene, made: Material, shifts: Shifts, side_px: int, unknowns: list[tuple[str, int]]
) -> Iterator[Floats]:
    """Derivatives (h, w, 3) of the picture in each unknown of the material, then in each shift."""
    values = {**made.shape, **made.colours}
    for name, c in unknowns:
        step = SHAPE_STEP * float(np.ravel(values[name])[c])
        aside = [_with(made, name, c, sign * step) for sign in (-1.0, 1.0)]
        yield _difference(*(_picture(scene, one, side_px) for one in aside), 2.0 * step)
    for j, sd in enumerate(shifts.sd):
        step = SHIFT_STEP * sd * np.eye(len(shifts.sd))[j]
        there = [_picture(shifted(scene, shifts, sign * step), made, side_px) for sign in (-1.0, 1.0)]
        yield _difference(*there, 2.0 * SHIFT_STEP * sd)


def _difference(before: Floats, after: Floats, width: float) -> Floats:
    return np.asarray((after - before) / width)


def _with(made: Material, name: str, channel: int, step: float) -> Material:
    """The material with one of its numbers changed."""
    values = {**made.shape, **made.colours}
    changed = np.array(values[name], float)
    changed[(channel,) * changed.ndim] += step
    return material(made.model, {**values, name: changed}, diffuse=made.diffuse)


def _picture(scene: Scene, made: Material, side_px: int) -> Floats:
    return render(scene, made, width_px=side_px, height_px=side_px, supersample=16).radiance()


def _usable(scene: Scene, side_px: int) -> np.ndarray:
    """Which quads (h / 2, w / 2) a fit looks at: those whose middle is safely inside the outline and safely lit."""
    y, x = 2.0 * np.indices((side_px // 2, side_px // 2)) + 0.5
    wary, seen = _wary(scene), surface(scene.camera, scene.sphere, x, y)
    lit = [
        np.sum(seen.normal * light.at(seen.normal)[0], axis=-1) > dark
        for light, dark in zip(scene.lights, wary.dark, strict=True)
    ]
    return (seen.offset2 < wary.furthest**2) & np.any(lit, axis=0)
