"""The complex index of refraction that reflects F0 at normal incidence and otherwise follows Schlick."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

DIELECTRIC_F0 = 0.2  # up to here k = 0: the exact dielectric


def complex_index(f0: Floats) -> tuple[Floats, Floats]:
    """Real part eta and absorption k (3,) each.

    Gulbrandsen 2014, "Artist friendly metallic Fresnel" (JCGT 3:4), writes all conductors of one F0 as a family
    between eta = (1 - F0) / (1 + F0) and the dielectric (1 + sqrt F0) / (1 - sqrt F0); of it, for metals, the one
    nearest to Schlick's curve is taken.
    """
    pairs = [_one(float(value)) for value in np.clip(f0, 0.0, 0.999)]
    return np.array([eta for eta, _ in pairs]), np.array([k for _, k in pairs])


def _one(f0: float) -> tuple[float, float]:
    root = np.sqrt(f0)
    dielectric = (1.0 + root) / (1.0 - root)
    if f0 <= DIELECTRIC_F0:
        return float(dielectric), 0.0
    eta = np.linspace((1.0 - f0) / (1.0 + f0), dielectric, 400)[:, None]
    k = np.sqrt(np.maximum((f0 * (eta + 1.0) ** 2 - (eta - 1.0) ** 2) / (1.0 - f0), 0.0))
    cosine = np.linspace(0.05, 1.0, 60)
    schlick = f0 + (1.0 - f0) * (1.0 - cosine) ** 5
    best = int(np.argmin(np.sum((reflectance(cosine, eta, k) - schlick) ** 2, axis=1)))
    return float(eta[best, 0]), float(k[best, 0])


def reflectance(cosine: Floats, eta: Floats, k: Floats) -> Floats:
    """Unpolarised Fresnel reflectance of a conductor in air; Born & Wolf, section 14.2."""
    sin2 = 1.0 - cosine**2
    t = eta**2 - k**2 - sin2
    ab = np.sqrt(t**2 + 4.0 * eta**2 * k**2)
    a = np.sqrt(np.maximum((ab + t) / 2.0, 0.0))
    s = (ab + cosine**2 - 2.0 * a * cosine) / (ab + cosine**2 + 2.0 * a * cosine)
    p = s * (cosine**2 * ab + sin2**2 - 2.0 * a * cosine * sin2) / (cosine**2 * ab + sin2**2 + 2.0 * a * cosine * sin2)
    return np.asarray((s + p) / 2.0)
