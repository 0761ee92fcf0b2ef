"""Separation by polarised light: no colour, no shape, only a filter before the lamp and one before the lens.

A highlight keeps the polarisation of the light; what a body scatters back has lost it. Behind an analyser at angle w

    picture(w) = diffuse / 2 + specular cos^2(w - w0),

w0 the analyser's angle parallel to the lamp's filter (Wolff & Boult 1991; Debevec et al. 2000, "Acquiring the
reflectance field of a human face", section 4). In Stokes' terms this is linear: intensity s0, and s1, s2 of the
highlight. w0 is one number for the whole picture, so the highlight is a projection of (s1, s2) on one direction, free
of the bias that the length of (s1, s2) has in noise. Filters that transmit less than half scale both layers alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Floats, readonly

from .samples import Mask

FLATTEST = 1e-6  # eigenvalue of the angles' normal matrix over its size: below it two unknowns look alike


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PolarisedLayers:
    """Layers (h, w, 3) radiance, NaN where a sample is unusable at any angle; diffuse + specular = without analyser.

    `covariance` (h, w, 3, 3) of (diffuse, specular) as var, cov, var along the last axis. `parallel_deg` is the
    analyser's angle at which highlights are brightest, with its sd. `chi2_reduced` is NaN where nothing is left over.
    """

    diffuse: Floats
    specular: Floats
    covariance: Floats
    parallel_deg: float
    parallel_sd_deg: float
    chi2_reduced: float

    def __post_init__(self) -> None:
        readonly(self)


def separate_polarised(
    pictures: Floats,
    angles_deg: Sequence[float],
    *,
    variance: Floats,
    usable: Mask | None = None,
    parallel_deg: float | None = None,
) -> PolarisedLayers:
    """Layers from `pictures` (k, h, w, 3), linear radiance through an analyser at `angles_deg` (k,).

    `variance` (3,) or (k, h, w, 3); `usable` (k, h, w, 3). With `parallel_deg` known two angles are enough, else three.
    Raises BadInputError for other shapes, for angles that leave the layers open, or where no highlight tells w0.
    """
    pictures, angles = np.asarray(pictures, float), np.radians(np.asarray(angles_deg, float))
    if pictures.ndim != 4 or pictures.shape[3] != 3 or angles.shape != pictures.shape[:1]:
        raise BadInputError(
            f"pictures have shape {pictures.shape} for {angles.size} angles; expected (angles, h, w, 3)"
        )
    variance = np.asarray(variance, float)
    if variance.shape not in ((3,), pictures.shape):
        raise BadInputError(f"variance has shape {variance.shape}; expected (3,) or {pictures.shape}")
    good = np.isfinite(pictures) if usable is None else np.isfinite(pictures) & usable
    good = np.broadcast_to(good.all(axis=0), pictures.shape)
    values = np.where(good, pictures, 0.0)
    sd = 0.0
    if parallel_deg is None:
        parallel, sd = _parallel(values, angles, variance)
    else:
        parallel = float(np.radians(parallel_deg))
    return _layers(values, good[0], angles, variance, parallel, sd)


def _solve(design: Floats, values: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Least squares over the angles: unknowns (n, h, w, 3) and their covariance (n, n, 3) or (n, n, h, w, 3).

    Weights are alike at all angles but for each sample's own variance in the covariance: unbiased, and exact.
    """
    normal = design.T @ design
    if np.linalg.eigvalsh(normal)[0] < FLATTEST * np.trace(normal):
        raise BadInputError("the analyser's angles do not tell the layers apart; expected ones spread over 180 degrees")
    inverse = np.linalg.solve(normal, design.T)
    if variance.ndim == 1:
        return np.tensordot(inverse, values, 1), (inverse @ inverse.T)[..., None] * variance
    return np.tensordot(inverse, values, 1), np.einsum("ik,jk,k...->ij...", inverse, inverse, variance)


def _parallel(values: Floats, angles: Floats, variance: Floats) -> tuple[float, float]:
    """The angle w0 and its sd, radians, from all highlights at once: the main direction of (s1, s2)."""
    design = 0.5 * np.stack([np.ones_like(angles), np.cos(2 * angles), np.sin(2 * angles)], axis=1)
    stokes, covariance = _solve(design, values, variance)
    q, u = stokes[1].ravel(), stokes[2].ravel()
    each = covariance[1:, 1:].reshape(2, 2, -1)
    noise = each.sum(axis=2) * (q.size / each.shape[2])  # one number a channel stands for all its samples
    moment = np.array([[q @ q, q @ u], [q @ u, u @ u]]) - noise
    (_, strength), axes = np.linalg.eigh(moment)
    scatter = np.sqrt(2.0 / q.size) * np.trace(noise)
    if strength <= 6 * scatter:
        raise BadInputError(
            "no polarised highlight stands out from the noise; give the parallel angle, or check the filters"
        )
    main = axes[:, 1] * (1.0 if axes[:, 1] @ (q.sum(), u.sum()) >= 0 else -1.0)
    side = np.array([-main[1], main[0]])
    sd = float(np.sqrt(side @ noise @ side / q.size / strength))
    return float(np.arctan2(main[1], main[0]) / 2), sd / 2


def _layers(
    values: Floats, good: Mask, angles: Floats, variance: Floats, parallel: float, sd: float
) -> PolarisedLayers:
    design = np.stack([np.full_like(angles, 0.5), np.cos(angles - parallel) ** 2], axis=1)
    (diffuse, specular), spread = _solve(design, values, variance)
    left = values - np.tensordot(design, np.stack([diffuse, specular]), 1)
    free = len(angles) - 2 - (1 if sd > 0 else 0) / max(good.sum(), 1)
    chi2 = float(np.sum(np.where(good, left**2 / np.maximum(variance, 1e-300), 0.0)))
    whole = spread.shape[2:] == good.shape
    covariance = np.stack([spread[0, 0], spread[0, 1], spread[1, 1]], axis=-1)
    covariance = covariance if whole else np.broadcast_to(covariance, (*good.shape, 3))
    return PolarisedLayers(
        diffuse=np.where(good, diffuse, np.nan),
        specular=np.where(good, specular, np.nan),
        covariance=np.where(good[..., None], covariance, np.nan),
        parallel_deg=float(np.degrees(parallel) % 180),
        parallel_sd_deg=float(np.degrees(sd)),
        chi2_reduced=chi2 / (free * good.sum()) if len(angles) > 2 and good.any() else np.nan,
    )
