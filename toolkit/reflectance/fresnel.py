"""F: the share of light that a smooth interface reflects, for unpolarised light; pure functions of one cosine.

Schlick's form is linear in F0: F = F0 (1 - s) + s. A fit therefore takes the pair (1 - s, s) as two columns. The exact
one of a dielectric bends so little in F0 that its tangent at a nearby F0 is a pair of the same kind.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import TINY, Number

FRESNEL = "schlick", "dielectric"  # by which a lobe's F0 can become its F at theta_d
TANGENT_F0 = 1e-4, 0.9  # between which a tangent in F0 is taken


def schlick_pair(cosine: Floats) -> tuple[Floats, Floats]:
    """(1 - s, s) with s = (1 - cos)^5; F = F0 (1 - s) + s (Schlick 1994)."""
    opposite = 1.0 - np.clip(cosine, 0.0, 1.0)
    s = np.square(np.square(opposite)) * opposite
    return 1.0 - s, s


def schlick(cosine: Floats, f0: Number) -> Floats:
    """Schlick's approximation with reflectance `f0` at normal incidence."""
    rest, s = schlick_pair(cosine)
    return np.asarray(f0 * rest + s)


def dielectric(cosine: Floats, index: Number) -> Floats:
    """Fresnel's reflectance from air onto a clear material of refractive `index` >= 1; exact."""
    c = np.clip(cosine, 0.0, 1.0)
    g = _inside(c, index)
    across, along = (c - g) / (c + g), _along(c, g, index)
    return np.asarray(0.5 * (np.square(across) + np.square(along)))


def dielectric_derivative(cosine: Floats, index: Number) -> tuple[Floats, Floats]:
    """Fresnel's reflectance of a clear material, and its derivative in `index`."""
    c = np.clip(cosine, 0.0, 1.0)
    n2, g = np.square(index), _inside(c, index)
    across, along = (c - g) / (c + g), _along(c, g, index)
    d_across = -2.0 * c * index / (g * np.square(c + g))
    d_along = 2.0 * c * index * (2.0 * np.square(g) - n2) / (g * np.square(n2 * c + g))
    return 0.5 * (np.square(across) + np.square(along)), across * d_across + along * d_along


def dielectric_slope(cosine: Floats, index: Number) -> Floats:
    """The derivative of a clear material's reflectance in the cosine."""
    c = np.clip(cosine, 0.0, 1.0)
    n2, g = np.square(index), _inside(c, index)
    across, along = (c - g) / (c + g), _along(c, g, index)
    steep = across / np.square(c + g) + along * n2 / np.square(n2 * c + g)
    return np.asarray(2.0 * (n2 - 1.0) / g * steep)


def _inside(c: Floats, index: Number) -> Floats:
    """The index times the refracted ray's cosine; kept off 0 for index 1 at grazing."""
    return np.asarray(np.sqrt(np.maximum(np.square(index) - 1.0 + np.square(c), TINY)))


def _along(c: Floats, g: Floats, index: Number) -> Floats:
    n2 = np.square(index)
    return np.asarray((n2 * c - g) / (n2 * c + g))


def dielectric_f0(index: Number) -> Floats:
    """Reflectance at normal incidence: ((n - 1) / (n + 1))^2; 0.040 for glass, 0.170 for diamond."""
    return np.asarray(np.square((np.asarray(index) - 1.0) / (np.asarray(index) + 1.0)))


def index_of(f0: Number) -> Floats:
    """The refractive index >= 1 of a clear material with reflectance `f0` < 1 at normal incidence."""
    root = np.sqrt(np.clip(f0, 0.0, 0.999))
    return np.asarray((1.0 + root) / (1.0 - root))


def dielectric_pair(cosine: Floats, f0: float) -> tuple[Floats, Floats]:
    """(b, a) with F = a + b F0 to first order around `f0`: the tangent of the exact reflectance, as `schlick_pair`."""
    near = float(np.clip(f0, *TANGENT_F0))
    value, by_index = dielectric_derivative(cosine, float(index_of(near)))
    slope = by_index / (np.sqrt(near) * np.square(1.0 - np.sqrt(near)))  # dn / dF0
    return slope, value - near * slope


def reflectance(cosine: Floats, f0: Number, kind: str) -> Floats:
    """F of reflectance `f0` at normal incidence, by one of `FRESNEL`; both broadcast."""
    return dielectric(cosine, index_of(f0)) if kind == "dielectric" else schlick(cosine, f0)


def conductor(cosine: Floats, n: Number, k: Number) -> Floats:
    """Fresnel's reflectance from air onto a metal of complex index n + i k; exact.

    Written without complex numbers as in Lagarde 2013, "Memo on Fresnel equations", after Born & Wolf.
    """
    c = np.clip(cosine, 0.0, 1.0)
    c2, s2 = np.square(c), 1.0 - np.square(c)
    t0 = np.square(n) - np.square(k) - s2
    a2_plus_b2 = np.sqrt(np.square(t0) + 4.0 * np.square(np.asarray(n) * k))
    a = np.sqrt(np.maximum(0.5 * (a2_plus_b2 + t0), 0.0))
    across = _ratio(a2_plus_b2 + c2, 2.0 * a * c)
    along = across * _ratio(c2 * a2_plus_b2 + np.square(s2), 2.0 * a * c * s2)
    return 0.5 * (across + along)


def _ratio(total: Floats, cross: Floats) -> Floats:
    return np.asarray((total - cross) / np.maximum(total + cross, TINY))
