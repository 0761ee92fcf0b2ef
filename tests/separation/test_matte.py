"""The one-sided fit of the matte line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from toolkit.separation.matte import CENTRES, DENSITY, SLOPE, STEP, Edge, lower_edge

TRUE = 1.4


def cloud(share: float, noise: float, seed: int, count: int = 2000) -> tuple[np.ndarray, ...]:
    """Samples of which `share` lie on the line, the others above it by up to 0.5; noise in t and in m."""
    rng = np.random.default_rng(seed)
    m = rng.uniform(0.15, 1.0, count)
    above = np.where(rng.random(count) < share, 0.0, rng.uniform(0, 0.5, count))
    t = TRUE * m + above + noise * rng.standard_normal(count)
    variance = np.full(count, noise**2)
    return t, m + noise * rng.standard_normal(count), variance, variance, np.zeros(count)


def fits(share: float, noise: float, seeds: range) -> list[Edge]:
    return [lower_edge(*cloud(share, noise, seed)) for seed in seeds]


@pytest.mark.parametrize("share", [0.9, 0.5, 0.2])
@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_the_edge_is_found_without_bias(share: float, noise: float) -> None:
    """The mean of 20 fits is the true slope within four of its own sds, noise in both coordinates."""
    slopes = np.array([fit.slope for fit in fits(share, noise, range(20))])
    assert abs(slopes.mean() - TRUE) < 4 * slopes.std(ddof=1) / np.sqrt(20) + 2e-4


def test_the_minimum_and_least_squares_would_fail() -> None:
    """On the same samples the lowest ratio takes noise for the edge, and least squares the highlight for body."""
    t, m, *_ = cloud(0.5, 1e-2, 0)
    assert TRUE - np.min(t / m) > 0.05
    assert (t @ m) / (m @ m) - TRUE > 0.1
    assert abs(lower_edge(*cloud(0.5, 1e-2, 0)).slope - TRUE) < 0.005


def band(count: int, significance: float = 1e-3) -> tuple[float, float]:
    """Where the mean of `count` squares of standard normals lies, but for one chance in a thousand."""
    low, high = chi2.ppf([significance / 2, 1 - significance / 2], count) / count
    return float(low), float(high)


@pytest.mark.parametrize(("share", "noise"), [(0.9, 1e-2), (0.6, 5e-3), (0.3, 1e-3)])
def test_the_stated_sd_is_the_scatter(share: float, noise: float) -> None:
    """Over 40 sets of samples z^2 averages 1 as chi-squared allows; an sd half as large or twice would be seen."""
    z2 = np.mean([((fit.slope - TRUE) / fit.sd) ** 2 for fit in fits(share, noise, range(40))])
    low, high = band(40)
    assert low < z2 < high
    assert not low < z2 / 4 < high
    assert not low < z2 * 4 < high


def test_without_noise_the_edge_is_exact() -> None:
    """Clean samples give the slope to nine digits, and the share of those that lie on it."""
    edge = lower_edge(*cloud(0.7, 0.0, 1))
    assert edge.slope == pytest.approx(TRUE, abs=1e-9)


def test_one_stray_sample_far_below_does_not_count() -> None:
    """A single foreign pixel under the line leaves it where it is; a minimum would follow."""
    t, m, *noise = cloud(0.6, 1e-3, 2)
    clean = lower_edge(t, m, *noise).slope
    t[0] -= 0.5
    assert abs(lower_edge(t, m, *noise).slope - clean) < 1e-4


def test_the_mixture_is_made_of_densities_and_their_slopes() -> None:
    """Each component's derivative is that of its density, by central differences."""
    centre = np.abs(CENTRES) < 6
    rise = np.gradient(DENSITY, STEP, axis=1)
    assert np.abs(rise - SLOPE)[:, centre].max() < 5e-3
