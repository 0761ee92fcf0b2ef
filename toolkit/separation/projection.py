"""Every pixel on the two colours: x = a body + s light, by weighted least squares, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

from .coefficients import Solver
from .samples import Samples

CHUNK = 32768  # pixels at a time: their temporary arrays stay in the processor's cache


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layers:
    """Coefficients (h, w) in float32, NaN off the sphere and where fewer than two channels are usable.

    `covariance` (h, w, 3) of the two as var, cov, var. `residual` (h, w) is the signed distance from
    the plane of the two colours, NaN below three channels.
    """

    along_body: Floats
    along_light: Floats
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
                along_body=(self.along_body * np.float64(unit)).astype(np.float32),
                along_light=(self.along_light * np.float64(unit)).astype(np.float32),
                covariance=(self.covariance * np.float64(unit) ** 2).astype(np.float32),
                residual=(self.residual * np.float64(unit)).astype(np.float32),
            )


def project(
    picture: Samples, body: Floats, light: Floats, *, body_covariance: Floats, light_covariance: Floats
) -> Layers:
    """Layers of every pixel; the colours' own covariances (3, 3) are carried into theirs."""
    shape = picture.on_sphere.shape
    values, usable, variance = (_channels(each) for each in (picture.values, picture.usable, picture.variance))
    count, each, kind = values.shape[1], variance.shape[1] > 1, values.dtype
    shared = colour_share(body, light, variance, body_covariance, light_covariance).T.astype(kind)
    along, covariance, residual = (np.empty((rows, count), np.float32) for rows in (2, 3, 1))
    solver = Solver.of(body, light, kind)
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        found = solver.solve(values[:, part], usable[:, part], variance[:, part] if each else variance)
        along[:, part], residual[:, part] = found.both, found.off
        np.add(found.covariance, shared @ np.square(found.both), out=covariance[:, part])
    return Layers(
        along_body=along[0].reshape(shape),
        along_light=along[1].reshape(shape),
        covariance=np.moveaxis(covariance.reshape(3, *shape), 0, -1),
        residual=residual.reshape(shape),
    )


def _channels(picture: NDArray[Any]) -> NDArray[Any]:
    """A picture (h, w, 3), or one colour (3,), as (3, N)."""
    return np.moveaxis(picture, -1, 0).reshape(3, -1)


def unknown(picture: Samples) -> Layers:
    """Layers that say nothing: NaN, with infinite variance on the sphere."""
    nothing = np.full(picture.on_sphere.shape, np.nan, np.float32)
    spread = np.where(picture.on_sphere[..., None], np.array([np.inf, np.nan, np.inf], np.float32), np.float32(np.nan))
    return Layers(along_body=nothing, along_light=nothing, covariance=spread, residual=nothing)


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
