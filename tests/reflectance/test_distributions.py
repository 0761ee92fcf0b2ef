"""D: normalised, of the width it says, with the slope it says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import dawsn

from tests.laws.space import direction, seen
from toolkit.reflectance import distributions as d

WIDTHS = [0.005, 0.03, 0.1, 0.3, 0.5, 0.8, 1.0]
DENSITIES = {
    "gaussian": d.gaussian,
    "beckmann": d.beckmann,
    "ggx": d.ggx,
    "gtr 1": lambda c, a: d.gtr(c, a, 1.0),
    "gtr 1.5": lambda c, a: d.gtr(c, a, 1.5),
    "gtr 2.5": lambda c, a: d.gtr(c, a, 2.5),
    "gtr 5": lambda c, a: d.gtr(c, a, 5.0),
}


def _at(theta):
    """Cosines with the half vector at angle theta, light and view together."""
    tilted = direction(theta, 0.0)
    return seen(tilted, tilted)


def _projected(density, width):
    """The integral of D cos(theta) over the hemisphere, in steps that grow from the normal."""
    edges = np.concatenate([[0.0], np.geomspace(1e-4, np.pi / 2, 60)])
    node, weight = np.polynomial.legendre.leggauss(20)
    half = 0.5 * np.diff(edges)[:, None]
    theta = (edges[:-1, None] + half * (1.0 + node)).ravel()
    return np.sum(density(_at(theta), width) * np.sin(2 * theta) * np.pi * (half * weight).ravel())


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", DENSITIES)
def test_a_density_is_normalised(name, width):
    """The facets' projected area is the surface's: int D cos = 1 within 1e-6."""
    assert abs(_projected(DENSITIES[name], width) - 1.0) < 1e-6


def test_an_unbounded_normaliser_would_fail():
    """Dawson's function alone, the integral to infinity, is off by more than that beyond 0.3 rad."""

    def unbounded(cosines, sigma):
        return np.exp(-d.theta2_h(cosines) / (2 * sigma**2)) / (np.sqrt(2) * np.pi * sigma * dawsn(np.sqrt(2) * sigma))

    assert abs(_projected(unbounded, 0.2) - 1.0) < 1e-6
    assert abs(_projected(unbounded, 0.5) - 1.0) > 5e-4


def test_the_gaussian_agrees_with_a_direct_integral():
    """Its normaliser in closed form is the integral it stands for."""
    for sigma in (0.1, 0.4, 0.8):
        area, _ = quad(lambda t, s=sigma: np.pi * np.exp(-t * t / (2 * s * s)) * np.sin(2 * t), 0.0, np.pi / 2)
        assert d.gaussian(_at(0.0), sigma) == pytest.approx(1.0 / area, rel=1e-9)


def test_beckmann_has_the_slopes_it_says():
    """The slope along one axis has standard deviation alpha / sqrt(2)."""
    alpha = 0.3
    tangent = lambda t: np.tan(t) ** 2 / 2 * d.beckmann(_at(t), alpha) * np.sin(2 * t) * np.pi  # noqa: E731  # one formula
    variance, _ = quad(tangent, 0.0, np.pi / 2 - 1e-9)
    assert np.sqrt(variance) == pytest.approx(alpha / np.sqrt(2), rel=1e-6)


@pytest.mark.parametrize(("alpha", "ratio"), [(0.1, 1.003), (0.2, 1.013), (0.3, 1.027), (0.5, 1.064)])
def test_best_gaussian_angle_for_a_beckmann_lobe(alpha, ratio):
    """Least squares weighted by sin cos, amplitude free: computed independently of this code."""
    from scipy.optimize import minimize_scalar

    theta = np.linspace(0.0, np.pi / 2 - 1e-6, 4001)
    weight, target = np.sin(theta) * np.cos(theta), d.beckmann(_at(theta), alpha)

    def misfit(sigma):
        shape = d.gaussian(_at(theta), sigma)
        scale = np.sum(weight * shape * target) / np.sum(weight * shape * shape)
        return np.sum(weight * (target - scale * shape) ** 2)

    best = minimize_scalar(misfit, bounds=(alpha / 3, alpha), method="bounded", options={"xatol": 1e-8}).x
    assert best * np.sqrt(2) / alpha == pytest.approx(ratio, abs=1.5e-3)


@pytest.mark.parametrize("width", WIDTHS)
def test_derivatives_in_the_width(width):
    """Complex step where the density takes complex numbers, central differences where it does not."""
    cosines = _at(np.linspace(0.0, 1.5, 40))
    for density, derivative in ((d.beckmann, d.beckmann_derivative), (d.ggx, d.ggx_derivative)):
        value, slope = derivative(cosines, width)
        stepped = np.asarray(_complex(density)(cosines, width + 1e-30j)).imag / 1e-30
        np.testing.assert_allclose(slope, stepped, rtol=1e-9, atol=1e-9 * np.abs(stepped).max())
        np.testing.assert_array_equal(value, density(cosines, width))


def _complex(density):
    """The density's formula on complex widths."""
    return {
        d.beckmann: lambda c, a: np.exp(-c.sin2_h / c.n_dot_h**2 / a**2) / (np.pi * a**2 * c.n_dot_h**4),
        d.ggx: lambda c, a: a**2 / (np.pi * (c.n_dot_h**2 * (a**2 - 1) + 1) ** 2),
    }[density]
