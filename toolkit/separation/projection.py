"""Every pixel on the two colours: x = a body + s light, by weighted least squares, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .samples import Mask, Samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coefficients:
    """Body `a` and light `s` coefficients (n,) of the sphere's pixels, row by row, and their covariance (n, 3).

    `seen` (n,) counts the channels each rests on: 3, 2 beside a clipped one; below 2 there is no answer (NaN).
    `residual` (n,) is the signed distance from the plane of the two colours, NaN below 3.
    """

    body: Floats
    light: Floats
    covariance: Floats
    residual: Floats
    seen: Floats

    def __post_init__(self) -> None:
        readonly(self)


def project(
    picture: Samples, body: Floats, light: Floats, *, body_covariance: Floats, light_covariance: Floats
) -> Coefficients:
    """Coefficients of every pixel on the sphere; the colours' own covariances (3, 3) are carried into theirs."""
    on = picture.on_sphere
    values, usable = picture.values[on], picture.usable[on]
    variance = picture.variance if picture.variance.ndim == 1 else picture.variance[on]
    weight = usable / variance
    normal = weight @ np.stack([body * body, body * light, light * light], axis=1)
    bb, bl, ll = normal.T
    right = (weight * values) @ np.stack([body, light], axis=1)
    seen = usable.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(seen >= 2, 1.0 / (bb * ll - bl * bl), np.nan)
        a = (ll * right[:, 0] - bl * right[:, 1]) * inverse
        s = (bb * right[:, 1] - bl * right[:, 0]) * inverse
        covariance = np.stack([ll * inverse, -bl * inverse, bb * inverse], axis=1)
    covariance += _from_colours(a, s, body, light, variance, body_covariance, light_covariance)
    across = np.cross(body, light)
    across /= max(float(np.linalg.norm(across)), 1e-300)
    residual = np.where(seen == 3, values @ across, np.nan)
    return Coefficients(body=a, light=s, covariance=covariance, residual=residual, seen=seen)


def _from_colours(
    a: Floats, s: Floats, body: Floats, light: Floats, variance: Floats, of_body: Floats, of_light: Floats
) -> Floats:
    """What uncertain colours add, (n, 3): the shift of (a, s) is -G (a dbody + s dlight), G the pseudo-inverse."""
    typical = variance if variance.ndim == 1 else variance.mean(axis=0)
    pair = np.stack([body, light], axis=1)
    weighted = pair / typical[:, None]
    inverse = np.linalg.pinv(weighted.T @ pair) @ weighted.T
    of_body, of_light = inverse @ of_body @ inverse.T, inverse @ of_light @ inverse.T
    entries = ((0, 0), (0, 1), (1, 1))
    return np.stack([a * a * of_body[e] + s * s * of_light[e] for e in entries], axis=1)


def picture_of(values: Floats, on: Mask) -> Floats:
    """Scatter per-pixel values (n, ...) back into a picture (h, w, ...), NaN off the sphere."""
    out = np.full(on.shape + values.shape[1:], np.nan)
    out[on] = values
    return out
