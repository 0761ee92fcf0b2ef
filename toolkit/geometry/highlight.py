"""Where the lamp stands, read off the glossy ball itself: a start for the fit, with an error to match.

Shading and highlight are explained together: for every direction of a grid over the half space in front of the camera,
radiance is least-squares fitted by Lambert's cosine and two Blinn-Phong lobes; the best direction is refined. Neither
alone would do: the brightest place of a rough ball is not its highlight, and shading alone is off by degrees on gloss.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag, flagged
from toolkit.records import Camera, Floats, Sphere

from .sphere import Surface, surface
from .tangents import tangents

GLOSSES = (60.0, 1000.0)  # shininesses of the two lobes: a broad and a sharp highlight
GRID = 500  # directions tried
PLACES = 4000  # of the sphere's pixels, spread evenly; the brightest come on top
BRIGHTEST = 400
MIN_N_DOT_V = 0.2
SEEN_GAIN = 0.15  # share of the residual's variance that the lobes must remove for a highlight to count as seen
SD_DEG, UNSEEN_SD_DEG = 1.0, 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LightFound:
    """A direction towards the light, how well it is known, and whether a highlight was there to tell it."""

    direction: tuple[float, float, float]
    sd_deg: float
    highlight_seen: bool


def light_from_highlight(
    picture: Floats,
    *,
    sphere: Sphere,
    camera: Camera,
    origin_px: tuple[float, float],
    step_px: float,
    flags: NDArray[np.uint8] | None = None,
) -> LightFound:
    """The direction of a single far light from a linear picture (h, w, 3) placed as in `Plane`.

    Raises BadInputError where the sphere shows no shading at all.
    """
    seen, value = _places(picture, sphere, camera, origin_px, step_px, flags)
    directions = _directions()
    residuals = [_residual(seen, value, light)[0] for light in directions]
    best = _refined(seen, value, directions[int(np.argmin(residuals))])
    left, gain = _residual(seen, value, best)
    if left > 0.9 * float(np.sum((value - value.mean()) ** 2)):
        raise BadInputError(
            "no light found: the shading shows no direction; expected one lamp in a dark room; or give --light X,Y,Z"
        )
    x, y, z = (float(v) for v in best)
    glossy = gain > SEEN_GAIN
    return LightFound(direction=(x, y, z), sd_deg=SD_DEG if glossy else UNSEEN_SD_DEG, highlight_seen=glossy)


def unexplained(
    picture: Floats,
    directions: Sequence[tuple[float, float, float]],
    *,
    sphere: Sphere,
    camera: Camera,
    origin_px: tuple[float, float],
    step_px: float,
    flags: NDArray[np.uint8] | None = None,
) -> float:
    """The share of a sphere's shading, as variance, that far lights from these directions leave unexplained."""
    seen, value = _places(picture, sphere, camera, origin_px, step_px, flags)
    shading = float(np.sum((value - value.mean()) ** 2))
    columns = [np.ones((len(value), 1)), *(_lobes(seen, np.asarray(light)) for light in directions)]
    full = np.concatenate(columns, axis=1)
    return float(np.sum((value - full @ _nonnegative(full, value)) ** 2)) / max(shading, 1e-30)


def _places(
    picture: Floats,
    sphere: Sphere,
    camera: Camera,
    origin_px: tuple[float, float],
    step_px: float,
    flags: NDArray[np.uint8] | None,
) -> tuple[Surface, Floats]:
    """Surface and brightness at places spread over the sphere, and at its brightest."""
    row, column = np.mgrid[: picture.shape[0], : picture.shape[1]].reshape(2, -1)
    x, y = origin_px[0] + step_px * column, origin_px[1] + step_px * row
    near = np.hypot(x - sphere.centre_px[0], y - sphere.centre_px[1]) < 1.2 * sphere.radius_px
    if flags is not None:
        near &= ~flagged(flags.ravel(), SampleFlag.INVALID)
    index = np.flatnonzero(near)
    brightness = picture.reshape(-1, picture.shape[2]).mean(axis=1)
    spread = index[:: max(len(index) // PLACES, 1)]
    seen = surface(camera, sphere, x[index], y[index])
    facing = seen.on_sphere & (np.einsum("ni,ni->n", seen.normal, seen.view) > MIN_N_DOT_V)
    bright = index[facing][np.argsort(brightness[index[facing]])[-BRIGHTEST:]]
    chosen = np.union1d(np.intersect1d(spread, index[facing]), bright)
    return surface(camera, sphere, x[chosen], y[chosen]), np.asarray(brightness[chosen], float)


def _directions() -> Floats:
    """Directions spread evenly over the half space in front, and a little behind (a golden spiral)."""
    k = np.arange(GRID) + 0.5
    z = 1.0 - 1.3 * k / GRID
    turn = np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def _residual(seen: Surface, value: Floats, light: Floats) -> tuple[float, float]:
    """Sum of squares left under a light, and the share of Lambert's residual that the lobes remove."""
    lobes = _lobes(seen, light)
    matte = np.column_stack([lobes[:, 0], np.ones(len(lobes))])
    full = np.column_stack([matte, lobes[:, 1:]])
    squares = [float(np.sum((value - a @ _nonnegative(a, value)) ** 2)) for a in (matte, full)]
    return squares[1], 1.0 - squares[1] / max(squares[0], 1e-30)


def _lobes(seen: Surface, light: Floats) -> Floats:
    """Columns (N, 3) of radiance under a light: Lambert's cosine, a broad and a sharp highlight."""
    half = light + seen.view
    half = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)
    lit = np.maximum(seen.normal @ light, 0.0)
    cosine = np.maximum(np.einsum("ni,ni->n", seen.normal, half), 0.0) * (lit > 0)
    return np.column_stack([lit, *(cosine**n for n in GLOSSES)])


def _nonnegative(columns: Floats, value: Floats) -> Floats:
    from scipy.optimize import nnls

    return np.asarray(nnls(columns.T @ columns, columns.T @ value)[0])


def _refined(seen: Surface, value: Floats, light: Floats) -> Floats:
    """The direction of least residual near a first one, by shrinking steps across it."""
    step = 0.08
    best, left = light, _residual(seen, value, light)[0]
    while step > 5e-4:
        across, along = tangents(best)
        turns = [best + step * (np.cos(a) * across + np.sin(a) * along) for a in np.arange(8) * np.pi / 4]
        turns = [t / np.linalg.norm(t) for t in turns]
        tried = [_residual(seen, value, t)[0] for t in turns]
        if min(tried) < left:
            best, left = turns[int(np.argmin(tried))], min(tried)
        else:
            step /= 2
    return np.asarray(best)
