"""Pooling over space: less noise, edges kept, honest variances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2
from skimage.metrics import normalized_root_mse

from tests.separation.balls import ball, clip, layers_of, noisy
from tests.separation.test_dichromatic import mean_square_z, psnr
from toolkit.flags import Flag
from toolkit.separation import pool
from toolkit.separation.local import local_quadratic
from toolkit.separation.pooling import adaptive

SD = 0.01


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
def test_pooling_reaches_42_db(sigma: float) -> None:
    """1 % noise: the diffuse layer at 42 dB and more, the specular layer's error at least halved."""
    picture = ball(sigma, peak=0.95)
    single = layers_of(noisy(picture, SD), picture, SD)
    pooled = pool(single)
    on = picture.on_sphere
    assert psnr(pooled.diffuse, picture.diffuse, on) > 42
    truth = picture.specular[on]
    assert normalized_root_mse(truth, pooled.specular[on]) < 0.5 * normalized_root_mse(truth, single.specular[on])
    assert np.isnan(pooled.diffuse[~on]).all()
    assert pooled.method == "dichromatic, pooled"


def test_the_pooled_variance_is_the_error() -> None:
    """The body's mean z^2 is 1 as chi-squared allows for as many cases as there are windows' worth of pixels.

    Variances a third off would be seen. The light's coefficient is stated to caution, by a factor of 2 at most.
    """
    picture = ball(0.2)
    single = layers_of(noisy(picture, SD), picture, SD)
    found = pool(single)
    on = picture.on_sphere
    windows = float(np.sum(found.covariance[on][:, 0] / single.covariance[on][:, 0]))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], windows) / windows
    of_body, of_light = mean_square_z(found, picture)
    assert low < of_body < high
    assert not low < of_body * 4 / 3 < high
    assert not low < of_body * 3 / 4 < high
    assert 0.5 < of_light < high


@pytest.mark.parametrize("sd", [0.003, 0.03])
def test_the_pooled_variance_follows_the_noise(sd: float) -> None:
    """At a third of that noise and at three times, the body's mean z^2 stays within 1/2 and 3/2."""
    picture = ball(0.2)
    found = pool(layers_of(noisy(picture, sd), picture, sd))
    assert 0.5 < mean_square_z(found, picture)[0] < 1.5


def test_an_edge_in_the_albedo_stays_sharp() -> None:
    """Stripes four to one in brightness keep their height within 3 % two pixels from the edge."""
    picture = ball(0.1)
    stripe = np.where((np.arange(256) // 24) % 2 == 0, 1.0, 0.25)[None, :, None]
    values = noisy(picture, 0.0) - picture.diffuse * (1 - stripe)
    values = values + SD * np.random.default_rng(1).standard_normal(values.shape)
    pooled = pool(layers_of(values, picture, SD))
    truth = picture.diffuse * stripe
    inside = np.isin(np.arange(256) % 24, np.arange(2, 22))[None, :] & (picture.diffuse[..., 0] > 0.4)
    ratio = (pooled.diffuse[..., 0] / np.where(truth[..., 0] > 0, truth[..., 0], 1))[inside]
    assert abs(np.median(ratio) - 1) < 0.01
    assert np.mean(np.abs(ratio - 1) < 0.1) > 0.9


def test_a_blur_would_not_keep_it() -> None:
    """A plain window of the largest size smears the same stripes by half."""
    stripe = np.broadcast_to(np.where((np.arange(96) // 12) % 2 == 0, 1.0, 0.25), (96, 96)).astype(float)
    blurred = local_quadratic(stripe, np.ones((96, 96)), 12).value
    kept = adaptive(stripe + 0.01 * np.random.default_rng(0).standard_normal(stripe.shape), np.full((96, 96), 1e-4))
    assert np.abs(blurred - stripe)[20:-20, 20:-20].max() > 0.3
    assert np.abs(kept.value - stripe)[20:-20, 20:-20].max() < 0.06


def test_a_blind_core_is_filled_from_around() -> None:
    """Where all channels clip, the pooled layers are complete, and the flag stays."""
    picture = ball(0.1, peak=0.9)
    values, usable = clip(noisy(picture, 0.003), 0.8)
    found = pool(layers_of(values, picture, 0.003, usable=usable))
    assert np.isfinite(found.diffuse[picture.on_sphere]).all()
    assert np.isfinite(found.specular[picture.on_sphere]).all()
    assert Flag.HIGHLIGHT_CLIPPED in found.flags


def test_layers_that_say_nothing_pool_to_nothing() -> None:
    """A grey body's NaN layers stay NaN."""
    picture = ball(body=(0.6, 0.6, 0.6))
    assert np.isnan(pool(layers_of(noisy(picture, SD), picture, SD)).diffuse).all()


@pytest.mark.parametrize("radius", [1, 2, 5])
def test_quadratics_are_reproduced(radius: int) -> None:
    """A local quadratic gives any quadratic back exactly, at borders and beside gaps too."""
    row, column = np.mgrid[:30, :40] / 10
    values = 1 + 0.5 * row - column + 0.3 * row * column - 0.2 * column**2 + row**2
    precision = np.ones(values.shape)
    precision[10:20, 15:22] = 0.0
    found = local_quadratic(np.where(precision > 0, values, 0.0), precision, radius)
    held = np.isfinite(found.value)
    assert held.mean() > 0.7
    assert np.abs(found.value - values)[held].max() < 1e-6


def test_the_local_variance_is_the_scatter() -> None:
    """Over 200 draws of unequal noise the fits scatter as stated, within 25 %."""
    rng = np.random.default_rng(8)
    variance = rng.uniform(0.5, 4, (15, 15))
    fits = [local_quadratic(np.sqrt(variance) * rng.standard_normal((15, 15)), 1 / variance, 3) for _ in range(200)]
    scatter = np.var([fit.value for fit in fits], axis=0)
    assert np.median(scatter / fits[0].variance) == pytest.approx(1, abs=0.05)
    assert np.abs(scatter / fits[0].variance - 1).max() < 0.5
