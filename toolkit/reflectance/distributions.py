"""D: how the normals of the facets spread about the surface's. Each integrates to 1: int D cos(theta_h) d omega_h = 1.

Every density takes the cosines and its width, and has its derivative in that width beside it.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number

_LEAST_COS2 = 1e-18  # keeps tan^4 finite, in single precision as well, where the half vector lies in the surface

_SQRT2, _SQRT_PI = sqrt(2.0), sqrt(pi)


def decay(exponent: Floats) -> Floats:
    """exp(-exponent), no smaller than 1e-260, in single precision 1e-35.

    Processors are slow with numbers at the end of their range.
    """
    return np.asarray(np.exp(-np.minimum(exponent, 80.0 if exponent.dtype == np.float32 else 600.0)))


def theta2_h(cosines: Cosines) -> Floats:
    """The squared angle between normal and half vector, rad^2, accurate near 0."""
    return np.asarray(np.square(np.arcsin(np.sqrt(np.minimum(cosines.sin2_h, 1.0)))))


def gaussian(cosines: Cosines, sigma: Number) -> Floats:
    """Gaussian in the facet's angle, sd `sigma` in rad: c exp(-theta_h^2 / (2 sigma^2)), in sr^-1.

    Torrance & Sparrow 1967; c makes the integral over the hemisphere 1.
    """
    return np.asarray(decay(theta2_h(cosines) * (0.5 / np.square(sigma))) / _gaussian_integral(sigma)[0])


def gaussian_derivative(cosines: Cosines, sigma: Number) -> tuple[Floats, Floats]:
    """The Gaussian density, and its derivative in `sigma`."""
    theta2 = theta2_h(cosines)
    integral, slope = _gaussian_integral(sigma)
    density = np.asarray(decay(theta2 * (0.5 / np.square(sigma))) / integral)
    return density, density * (theta2 / np.power(sigma, 3) - slope / integral)


def _gaussian_integral(sigma: Number) -> tuple[Floats, Floats]:
    """1/c = pi int_0^(pi/2) exp(-t^2 / (2 sigma^2)) sin(2t) dt, and its derivative in sigma.

    Dawson's function gives the integral to infinity, Faddeeva's w what lies beyond pi/2; by parts, the derivative
    of I = (1/c)/pi is I/sigma - 4 sigma I + 2 sigma (1 + exp(-pi^2 / (8 sigma^2))).
    """
    from scipy.special import dawsn, wofz

    width = np.asarray(sigma)
    x = _SQRT2 * width
    edge = np.exp(-np.square(np.pi / (2.0 * x)))
    beyond = 0.5 * _SQRT_PI * edge * np.imag(wofz(x + 0.5j * np.pi / x))
    integral = x * (dawsn(x) + beyond)
    slope = integral / width - 4.0 * width * integral + 2.0 * width * (1.0 + edge)
    return np.pi * integral, np.pi * slope


def beckmann(cosines: Cosines, alpha: Number) -> Floats:
    """Gaussian in the facet's slope, slope sd alpha / sqrt(2): exp(-tan^2/alpha^2) / (pi alpha^2 cos^4), in sr^-1.

    Beckmann & Spizzichino 1963, as in Walter et al. 2007, equation 25.
    """
    return _beckmann_and_tan2(cosines, alpha)[0]


def beckmann_derivative(cosines: Cosines, alpha: Number) -> tuple[Floats, Floats]:
    """Beckmann's density, and its derivative in `alpha`."""
    density, tan2 = _beckmann_and_tan2(cosines, alpha)
    return density, density * ((2.0 / np.power(alpha, 3)) * tan2 - 2.0 / np.asarray(alpha))


def _beckmann_and_tan2(cosines: Cosines, alpha: Number) -> tuple[Floats, Floats]:
    a2, sec2 = np.square(alpha), 1.0 / np.maximum(np.square(cosines.n_dot_h), _LEAST_COS2)
    tan2 = cosines.sin2_h * sec2
    return decay(tan2 * (1.0 / a2)) * np.square(sec2) * (1.0 / (np.pi * a2)), tan2


def ggx(cosines: Cosines, alpha: Number) -> Floats:
    """Trowbridge and Reitz's long tail: alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2), in sr^-1.

    Walter et al. 2007, equation 33.
    """
    a2 = np.square(alpha)
    return np.asarray((a2 / np.pi) / np.square(_stretched(cosines, a2)))


def ggx_derivative(cosines: Cosines, alpha: Number) -> tuple[Floats, Floats]:
    """GGX's density, and its derivative in `alpha`."""
    a2 = np.square(alpha)
    stretched = _stretched(cosines, a2)
    density = np.asarray((a2 / np.pi) / np.square(stretched))
    cos2 = 1.0 - cosines.sin2_h
    return density, density * (2.0 / np.asarray(alpha) - 4.0 * alpha * cos2 / stretched)


def _stretched(cosines: Cosines, a2: Number) -> Floats:
    """alpha^2 cos^2(theta_h) + sin^2(theta_h)."""
    return np.asarray(a2 + (1.0 - np.asarray(a2)) * cosines.sin2_h)


def gtr(cosines: Cosines, alpha: Number, tail: Number) -> Floats:
    """Trowbridge and Reitz's D with its exponent free: c / (alpha^2 cos^2 + sin^2)^tail, in sr^-1; tail 2 is `ggx`.

    Burley 2012, appendix B.2; finite at tail 1 and at alpha 1, where the paper's form is 0 / 0.
    """
    a2 = np.square(alpha)
    log_width, excess = np.log(a2), np.asarray(tail) - 1.0
    scale = _relative_growth(log_width) / (np.pi * _relative_growth(-excess * log_width))
    return np.asarray(scale * np.exp(-np.asarray(tail) * np.log(_stretched(cosines, a2))))


def gtr_derivatives(cosines: Cosines, alpha: Number, tail: Number) -> tuple[Floats, Floats, Floats]:
    """The generalised density, and its derivatives in `alpha` and `tail`."""
    a2 = np.square(alpha)
    log_width, excess = np.log(a2), np.asarray(tail) - 1.0
    density, stretched = gtr(cosines, alpha, tail), _stretched(cosines, a2)
    of_tail = _log_slope(-excess * log_width)
    by_width = (_log_slope(log_width) + excess * of_tail) * 2.0 / np.asarray(alpha)
    by_alpha = density * (by_width - 2.0 * np.asarray(tail) * alpha * (1.0 - cosines.sin2_h) / stretched)
    return density, by_alpha, density * (log_width * of_tail - np.log(stretched))


def _relative_growth(z: Number) -> Floats:
    """(exp(z) - 1) / z, 1 at 0."""
    near = np.abs(z) < 1e-9
    return np.where(near, 1.0 + 0.5 * np.asarray(z), np.expm1(z) / np.where(near, 1.0, z))


def _log_slope(z: Number) -> Floats:
    """The derivative of log((exp(z) - 1) / z): 1 / (1 - exp(-z)) - 1 / z, 1/2 at 0."""
    near = np.abs(z) < 1e-2
    safe = np.where(near, 1.0, z)
    return np.where(near, 0.5 + np.asarray(z) / 12.0 - np.power(z, 3) / 720.0, -1.0 / np.expm1(-safe) - 1.0 / safe)
