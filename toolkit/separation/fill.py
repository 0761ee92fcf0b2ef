"""Clipped pixels: what their unclipped channels tell, and their surroundings' body coefficient where those tell little.

The body's shading changes slowly where a highlight clips, so a quadratic through the pixels around foretells it. It
enters as a measurement with its own variance: two good channels outweigh it, one alone then gives the highlight, and
with none the clipping level gives the least that the highlight can be, with infinite variance.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .local import Local, local_quadratic
from .projection import Layers
from .samples import Mask, Samples

RADII = (4, 8, 16, 32, 64)  # px; the first whose window holds enough is taken
STEADY = 1.0  # a window's variance over that of a single pixel, beyond which it extrapolates


def fill(picture: Samples, layers: Layers, body: Floats, light: Floats) -> Layers:
    """The layers with clipped pixels completed; unchanged where all channels are usable."""
    whole = picture.usable[..., 0] & picture.usable[..., 1] & picture.usable[..., 2]
    holes = picture.on_sphere & ~whole
    if not holes.any():
        return layers
    box = _around(holes)
    along_body, along_light, covariance = (
        each.copy(order="K") for each in (layers.along_body, layers.along_light, layers.covariance)
    )
    along_body[holes], along_light[holes], covariance[holes] = _hole_rows(picture, layers, body, light, holes, box)
    return Layers(along_body=along_body, along_light=along_light, covariance=covariance, residual=layers.residual)


def _around(holes: Mask) -> tuple[slice, slice]:
    """The box of the holes and as much around them as a window may reach."""
    rows, columns = np.nonzero(holes.any(axis=1))[0], np.nonzero(holes.any(axis=0))[0]
    reach = RADII[-1]
    return (
        slice(max(int(rows[0]) - reach, 0), int(rows[-1]) + reach + 1),
        slice(max(int(columns[0]) - reach, 0), int(columns[-1]) + reach + 1),
    )


def _hole_rows(
    picture: Samples, layers: Layers, body: Floats, light: Floats, holes: Mask, box: tuple[slice, slice]
) -> tuple[Floats, Floats, Floats]:
    """Coefficients a, s (n,) and covariance (n, 3) of the holes' pixels."""
    guess = foretell(layers.along_body[box].astype(float), layers.covariance[box][..., 0], holes[box])
    inside = holes[box]
    a0, of_a0 = guess.value[inside], guess.variance[inside]
    prior = np.where(np.isfinite(of_a0), 1 / of_a0, 0.0)
    variance = np.broadcast_to(picture.variance, picture.values.shape)[holes]
    values, usable = picture.values[holes], picture.usable[holes]
    weight = usable / variance
    bb = weight @ (body * body) + prior
    bl, ll = weight @ (body * light), weight @ (light * light)
    b = (weight * values) @ body + prior * np.where(prior > 0, a0, 0.0)
    right = (weight * values) @ light
    independent = bb * ll - bl * bl
    sound = independent > 1e-14 * bb * ll
    inverse = np.where(sound, 1.0, np.nan) / np.where(sound, independent, 1.0)
    a, s = (ll * b - bl * right) * inverse, (bb * right - bl * b) * inverse
    spread = np.stack([ll * inverse, -bl * inverse, bb * inverse], axis=1)
    blind = ~usable.any(axis=1)
    least = np.max((values[blind] - a0[blind, None] * body) / np.maximum(light, 1e-6), axis=1)
    a[blind], s[blind] = a0[blind], np.maximum(least, 0.0)
    spread[blind] = np.stack([of_a0[blind], np.zeros(len(least)), np.full(len(least), np.inf)], axis=1)
    return a, s, spread


def foretell(body: Floats, variance: Floats, holes: Mask) -> Local:
    """Body coefficient (h, w) at the holes from around them, and its variance; NaN where nothing is near enough."""
    known = np.isfinite(body) & np.isfinite(variance) & ~holes
    precision = np.where(known, 1 / np.where(known, variance, 1.0), 0.0)
    single = float(np.median(variance[known])) if known.any() else np.inf
    value, spread = np.full(body.shape, np.nan), np.full(body.shape, np.nan)
    fresh = np.zeros(body.shape, bool)
    for radius in RADII:
        open_still = holes & ~np.isfinite(value)
        if not (open_still.any() or fresh.any()):
            break
        local = local_quadratic(np.where(known, body, 0.0), precision, radius)
        wider = fresh & np.isfinite(local.value)
        spread[wider] += (local.value[wider] - value[wider]) ** 2  # what a quadratic cannot follow
        fresh = open_still & (local.variance < STEADY * single)
        value[fresh], spread[fresh] = local.value[fresh], local.variance[fresh]
    return Local(value=value, variance=spread)
