"""Every pixel on the two colours: x = a body + s light, by weighted least squares, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

from .samples import Mask, Samples

THREADS = 2  # numpy lets go of the interpreter; the numbers are the same with one
CHUNK = 8192  # pixels at a time: their temporary arrays, in float64, stay in the processor's cache


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layers:
    """Pictures (h, w, ...) in float32, NaN off the sphere and where fewer than two channels are usable.

    `covariance` (h, w, 3) of the coefficients (a, s) as var, cov, var. `residual` (h, w) is the signed distance from
    the plane of the two colours, NaN below three channels.
    """

    diffuse: Floats
    specular: Floats
    covariance: Floats
    residual: Floats

    def __post_init__(self) -> None:
        readonly(self)

    def times(self, unit: float) -> Layers:
        """The layers in units so many times smaller."""
        if unit == 1.0:
            return self
        with np.errstate(over="ignore", under="ignore"):  # float32 ends where the picture's own units are extreme
            return Layers(
                diffuse=(self.diffuse * np.float64(unit)).astype(np.float32),
                specular=(self.specular * np.float64(unit)).astype(np.float32),
                covariance=(self.covariance * np.float64(unit) ** 2).astype(np.float32),
                residual=(self.residual * np.float64(unit)).astype(np.float32),
            )


def project(
    picture: Samples, body: Floats, light: Floats, *, body_covariance: Floats, light_covariance: Floats
) -> Layers:
    """Layers of every pixel; the colours' own covariances (3, 3) are carried into theirs."""
    shape = picture.on_sphere.shape
    values, usable, variance = (_channels(each) for each in (picture.values, picture.usable, picture.variance))
    count, each = values.shape[1], variance.shape[1] > 1
    shared = colour_share(body, light, variance, body_covariance, light_covariance)
    diffuse, specular, covariance = np.empty((3, 3, count), np.float32)
    residual = np.empty(count, np.float32)
    even = not each and float(body @ light) < 1 - 1e-12

    def some(starts: range) -> None:
        for start in starts:
            part = slice(start, start + CHUNK)
            noise = variance[:, part] if each else variance
            solve = _alike if even and _all_or_none(usable[:, part]) else _each
            a, s, spread, residual[part] = solve(values[:, part], usable[:, part], noise, body, light)
            a2, s2 = a * a, s * s
            for c in range(3):
                np.multiply(a, body[c], out=diffuse[c, part], casting="same_kind")
                np.multiply(s, light[c], out=specular[c, part], casting="same_kind")
                covariance[c, part] = spread[c] + a2 * shared[0, c] + s2 * shared[1, c]

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(some, (range(first * CHUNK, count, THREADS * CHUNK) for first in range(THREADS))))
    return Layers(
        diffuse=np.moveaxis(diffuse.reshape(3, *shape), 0, -1),
        specular=np.moveaxis(specular.reshape(3, *shape), 0, -1),
        covariance=np.moveaxis(covariance.reshape(3, *shape), 0, -1),
        residual=residual.reshape(shape),
    )


def _channels(picture: NDArray[Any]) -> NDArray[Any]:
    """A picture (h, w, 3), or one colour (3,), as (3, N)."""
    return np.moveaxis(picture, -1, 0).reshape(3, -1)


def unknown(picture: Samples) -> Layers:
    """Layers that say nothing: NaN, with infinite variance on the sphere."""
    nothing = np.full(picture.values.shape, np.nan, np.float32)
    spread = np.where(picture.on_sphere[..., None], np.array([np.inf, np.nan, np.inf], np.float32), nothing)
    return Layers(diffuse=nothing, specular=nothing, covariance=spread, residual=nothing[..., 0])


def _all_or_none(usable: Mask) -> bool:
    """Whether no pixel lacks some of its channels (3, n) but not all."""
    red = usable[0]
    return bool(np.array_equal(red, usable[1]) and np.array_equal(red, usable[2]))


def _alike(
    values: Floats, usable: Mask, variance: Floats, body: Floats, light: Floats
) -> tuple[Floats, Floats, Sequence[Any], Floats]:
    """Pixels of one variance with all channels, or none: one pseudo-inverse for all."""
    weighted = np.stack([body, light]) / variance[:, 0]
    inverse = np.linalg.inv(weighted @ np.stack([body, light], axis=1))
    a, s, residual = np.vstack([inverse @ weighted, _across(body, light)]) @ values
    missing = ~usable[0]
    if missing.any():
        for each in (a, s, residual):
            each[missing] = np.nan
    return a, s, (inverse[0, 0], inverse[0, 1], inverse[1, 1]), residual


def _each(
    values: Floats, usable: Mask, variance: Floats, body: Floats, light: Floats
) -> tuple[Floats, Floats, Sequence[Any], Floats]:
    """Two normal equations a pixel, solved in closed form: a, s, their (var, cov, var), the residual."""
    weight = np.divide(usable, variance, dtype=float)
    bb, bl, ll = np.stack([body * body, body * light, light * light]) @ weight
    b, l = np.stack([body, light]) @ (weight * values)  # noqa: E741  # beside bb, bl, ll the clearest name
    seen = usable[0].astype(np.intp) + usable[1] + usable[2]
    independent = bb * ll - bl * bl
    sound = (seen >= 2) & (independent > 1e-14 * bb * ll)  # below it rounding decides
    inverse = np.where(sound, 1.0, np.nan) / np.where(sound, independent, 1.0)
    bb, bl, ll = bb * inverse, bl * inverse, ll * inverse
    residual = _across(body, light) @ values
    residual[seen < 3] = np.nan
    return ll * b - bl * l, bb * l - bl * b, (ll, -bl, bb), residual


def _across(body: Floats, light: Floats) -> Floats:
    """Unit normal (3,) of the plane of the two colours."""
    normal = np.cross(body, light)
    return np.asarray(normal / max(float(np.linalg.norm(normal)), 1e-300))


def colour_share(body: Floats, light: Floats, variance: Floats, of_body: Floats, of_light: Floats) -> Floats:
    """What uncertain colours add: (2, 3), by which (a^2, s^2) is multiplied to give var, cov, var.

    (a, s) shifts by -G (a dbody + s dlight), with G (2, 3) the pseudo-inverse of the two colours, weighted by the
    samples' mean `variance` (3, n).
    """
    typical = variance[:, :: max(variance.shape[1] // 4096, 1)].mean(axis=1, dtype=float)
    pair = np.stack([body, light], axis=1)
    weighted = pair / typical[:, None]
    inverse = np.linalg.pinv(weighted.T @ pair) @ weighted.T
    of_body, of_light = inverse @ of_body @ inverse.T, inverse @ of_light @ inverse.T
    return np.stack([of_body[[0, 0, 1], [0, 1, 1]], of_light[[0, 0, 1], [0, 1, 1]]])
