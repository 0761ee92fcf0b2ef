"""Neighbours pooled: layers with less noise than one pixel's colour allows, without blurring edges.

Each coefficient is fitted by local quadratics in windows of growing size, and each pixel takes the largest window
whose confidence interval still meets those of all smaller ones (intersection of confidence intervals: Goldenshluger
& Nemirovski 1997, "On spatial adaptive estimation of nonparametric regression"; Katkovnik 1999). First the body
coefficient, the smoother one; then the light's, given the body's, where the picture itself is far more certain.
Neither noise nor edges are guessed: both follow from the covariance of each pixel.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import ColourLayers, Floats, readonly

from .local import local_quadratic
from .projection import colour_share
from .samples import Mask, unit_of

RADII = (1, 2, 3, 5, 8, 12)  # px
WIDTH = 2.0  # half the interval, in sd: narrower keeps edges, wider removes more noise
LEAST = 1e-14  # variance, of the brightest pixel squared: float32 holds no more
ORDER = 4.0  # power of the window with which a local quadratic's bias grows


def pool(layers: ColourLayers) -> ColourLayers:
    """The layers with their noise pooled over space; covariances are those of the pooled coefficients.

    Both coefficients are kept from falling below 0. Where nothing was known, the surroundings' values are taken.
    """
    unit = unit_of(np.nan_to_num(np.abs(layers.along_body) + np.abs(layers.along_light)))
    a, s = (along.astype(float) / unit for along in (layers.along_body, layers.along_light))
    whole = np.asarray(layers.covariance, float) / unit / unit
    systematic = _systematic(layers, a, s)
    covariance = np.where(np.isfinite(whole), _noise_alone(whole, systematic), np.inf)
    smooth_a, smooth_s, slope = _both(a, s, covariance)
    off = np.isnan(whole[..., 0])
    pooled = np.stack([smooth_a.variance, slope * smooth_a.variance, smooth_s.variance], axis=-1)
    return dataclasses.replace(
        layers,
        method=f"{layers.method}, pooled",
        along_body=_kept(smooth_a.value * unit, off),
        along_light=_kept(smooth_s.value * unit, off),
        covariance=np.where(off[..., None], np.nan, (pooled + systematic) * unit**2).astype(np.float32),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pooled:
    """Values (h, w) with the variance of their noise and the mean square of their bias."""

    value: Floats
    noise: Floats
    bias: Floats

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def variance(self) -> Floats:
        """Mean square of the whole error."""
        return self.noise + self.bias


def _both(a: Floats, s: Floats, covariance: Floats) -> tuple[Pooled, Pooled, Floats]:
    """Pooled coefficients, and how the light's follows the body's (h, w)."""
    var_a, shared, var_s = np.moveaxis(covariance, -1, 0)
    var_a = var_a + LEAST  # a variance of 0 is one that float32 could not hold
    smooth_a = adaptive(a, var_a)
    known = np.isfinite(covariance).all(axis=-1)
    slope = np.where(known, shared, 0.0) / np.where(known, var_a, 1.0)
    given = s + slope * np.where(known, smooth_a.value - a, 0.0)  # the light's coefficient once the body's is known
    of_given = np.where(known, var_s - slope * np.where(known, shared, 0.0), np.inf) + LEAST
    smooth_s = adaptive(given, of_given)
    with np.errstate(invalid="ignore"):
        finer_a, finer_s = smooth_a.noise / var_a, smooth_s.noise / of_given
        left = finer_s / (finer_a + finer_s)
    more = smooth_s.bias + left * slope**2 * smooth_a.noise  # smooth over a's window already, so over both
    return smooth_a, Pooled(value=smooth_s.value, noise=smooth_s.noise, bias=more), slope


def _kept(coefficient: Floats, off: Mask) -> Floats:
    return np.where(off, np.nan, np.maximum(coefficient, 0.0)).astype(np.float32)


def _systematic(layers: ColourLayers, a: Floats, s: Floats) -> Floats:
    """What the two colours' own errors put into each covariance (h, w, 3): pooling leaves it as it is."""
    share = colour_share(
        layers.body_colour, layers.light_colour, np.ones((3, 1)), layers.body_covariance, layers.light_covariance
    )
    return np.stack([a * a, s * s], axis=-1) @ share


def _noise_alone(whole: Floats, systematic: Floats) -> Floats:
    """Covariance less its systematic part, never below a hundredth of the whole."""
    rest = whole - systematic
    sound = (rest[..., [0, 2]] > 0.01 * whole[..., [0, 2]]).all(axis=-1) & (
        rest[..., 0] * rest[..., 2] > rest[..., 1] ** 2
    )
    return np.where(sound[..., None], rest, 0.01 * whole)


def adaptive(values: Floats, variance: Floats) -> Pooled:
    """Each pixel's value (h, w) from the largest window that its own data do not contradict."""
    known = np.isfinite(values) & np.isfinite(variance) & (variance > 0)
    best, spread = np.where(known, values, np.nan), np.where(known, variance, np.nan)
    sd = np.sqrt(spread)
    low, high = best - WIDTH * sd, best + WIDTH * sd
    going = np.ones(values.shape, bool)
    precision = np.where(known, 1 / np.where(known, variance, 1.0), 0.0)
    filled = np.where(known, values, 0.0)
    excess, chosen = np.zeros(values.shape), np.zeros(values.shape, np.intp)
    for radius in RADII:
        local = local_quadratic(filled, precision, radius)
        half = WIDTH * np.sqrt(local.variance)
        new_low, new_high = np.fmax(low, local.value - half), np.fmin(high, local.value + half)
        better = np.isfinite(local.value) & (~(local.variance > spread))
        fits = going & better & (new_low <= new_high)
        going &= fits | ~better
        low, high = np.where(fits, new_low, low), np.where(fits, new_high, high)
        excess = np.where(fits, ((local.value - best) ** 2 - (spread - local.variance)) / local.variance, excess)
        chosen = np.where(fits, radius, chosen)
        best, spread = np.where(fits, local.value, best), np.where(fits, local.variance, spread)
    return Pooled(value=best, noise=spread, bias=spread * _bias(chosen, np.nan_to_num(excess)))


def _bias(chosen: NDArray[np.intp], excess: Floats) -> Floats:
    """Square of the bias over the noise's variance (h, w), by the window chosen.

    Windows of one model are nested, so the larger one's fit moves from the smaller one's by the difference of their
    variances, and by that of their biases. A local quadratic's bias grows with the fourth power of the window.
    """
    most = np.zeros(max(RADII) + 1)
    for smaller, radius in zip((0, *RADII), RADII, strict=False):
        there = chosen == radius
        if there.any():
            most[radius] = max(float(excess[there].mean()), 0.0) / (1 - (smaller / radius) ** ORDER) ** 2
    return np.asarray(most[chosen])
