"""Neighbours pooled: layers with less noise than one pixel's colour allows, without blurring edges.

Each coefficient is fitted by local quadratics in windows of growing size, and each pixel takes the largest window
whose confidence interval still meets those of all smaller ones (intersection of confidence intervals: Goldenshluger
& Nemirovski 1997, "On spatial adaptive estimation of nonparametric regression"; Katkovnik 1999). First the body
coefficient, the smoother one; then the light's, given the body's, where the picture itself is far more certain.
Neither noise nor edges are guessed: both follow from the covariance of each pixel.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from toolkit.records import ColourLayers, Floats

from .local import Local, local_quadratic
from .projection import colour_share

RADII = (1, 2, 3, 5, 8, 12)  # px
WIDTH = 2.0  # half the interval, in sd: narrower keeps edges, wider removes more noise
BIASED = 3.0  # on variances: the largest window not contradicted has a bias of its own, 1.4 sd on rendered spheres


def pool(layers: ColourLayers) -> ColourLayers:
    """The layers with their noise pooled over space; covariances are those of the pooled coefficients.

    Both coefficients are kept from falling below 0. Where nothing was known, the surroundings' values are taken.
    """
    body, light = layers.body_colour, layers.light_colour
    a, s = layers.diffuse @ body, layers.specular @ light
    whole = np.asarray(layers.covariance, float)
    systematic = _systematic(layers, a, s)
    var_a, shared, var_s = np.moveaxis(np.where(np.isfinite(whole), _noise_alone(whole, systematic), np.inf), -1, 0)
    smooth_a = adaptive(a, var_a)
    with np.errstate(invalid="ignore"):
        slope = np.where(np.isfinite(var_a), shared / var_a, 0.0)
        given = s + slope * (smooth_a.value - a)  # the light's coefficient once the body's is known
        smooth_s = adaptive(given, var_s - slope * shared + slope**2 * smooth_a.variance)
    covariance = np.stack([smooth_a.variance, slope * smooth_a.variance, smooth_s.variance], axis=-1)
    return dataclasses.replace(
        layers,
        method=f"{layers.method}, pooled",
        diffuse=(np.maximum(smooth_a.value, 0.0)[..., None] * body).astype(np.float32),
        specular=(np.maximum(smooth_s.value, 0.0)[..., None] * light).astype(np.float32),
        covariance=(BIASED * covariance + systematic).astype(np.float32),
    )


def _systematic(layers: ColourLayers, a: Floats, s: Floats) -> Floats:
    """What the two colours' own errors put into each covariance (h, w, 3): pooling leaves it as it is."""
    share = colour_share(
        layers.body_colour, layers.light_colour, np.ones((1, 3)), layers.body_covariance, layers.light_covariance
    )
    return np.stack([a * a, s * s], axis=-1) @ share


def _noise_alone(whole: Floats, systematic: Floats) -> Floats:
    """Covariance less its systematic part, never below a hundredth of the whole."""
    rest = whole - systematic
    sound = (rest[..., [0, 2]] > 0.01 * whole[..., [0, 2]]).all(axis=-1) & (
        rest[..., 0] * rest[..., 2] > rest[..., 1] ** 2
    )
    return np.where(sound[..., None], rest, 0.01 * whole)


def adaptive(values: Floats, variance: Floats) -> Local:
    """Each pixel's value (h, w) from the largest window that its own data do not contradict."""
    known = np.isfinite(values) & np.isfinite(variance) & (variance > 0)
    best, spread = np.where(known, values, np.nan), np.where(known, variance, np.nan)
    sd = np.sqrt(spread)
    low, high = best - WIDTH * sd, best + WIDTH * sd
    going = np.ones(values.shape, bool)
    precision = np.where(known, 1 / np.where(known, variance, 1.0), 0.0)
    filled = np.where(known, values, 0.0)
    for radius in RADII:
        local = local_quadratic(filled, precision, radius)
        half = WIDTH * np.sqrt(local.variance)
        new_low, new_high = np.fmax(low, local.value - half), np.fmin(high, local.value + half)
        better = np.isfinite(local.value) & (~(local.variance > spread))
        fits = going & better & (new_low <= new_high)
        going &= fits | ~better
        low, high = np.where(fits, new_low, low), np.where(fits, new_high, high)
        best, spread = np.where(fits, local.value, best), np.where(fits, local.variance, spread)
    return Local(value=best, variance=spread)
