"""The microfacet lobe that a renderer knows, nearest to the one that was fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance import LOBES, Cosines

RENDERERS = ("beckmann", "ggx")  # with Smith's masking: what every renderer has
ALPHA = (1e-3, 1.0)
CORE = 0.02  # the highlight is compared down to this share of its peak


@dataclass(frozen=True, slots=True, kw_only=True)
class Equivalent:
    """`gain` times the lobe of `distribution` and `alpha` stands for the fitted one; `misfit` is its relative rms."""

    distribution: str
    alpha: float
    gain: float
    misfit: float


def equivalents(
    model: str,
    shape: Mapping[str, float],
    variant: Mapping[str, str],
    *,
    half_angle_rad: float,
    gain: float | None = None,
) -> dict[str, Equivalent]:
    """The nearest Beckmann and GGX lobe with Smith's masking, by name; of the amplitude given, or of any.

    Nearest: least squares over the highlight under the photograph's own geometry (light and view 2 x
    `half_angle_rad` apart), each direction weighted by its solid angle.
    """
    lobe = LOBES[model]
    numbers = [shape[p.name] for p in lobe.parameters]
    everywhere, _ = _cap(half_angle_rad, np.pi / 2 - half_angle_rad)
    cosines, weight = _cap(half_angle_rad, _reach(everywhere, lobe.value(everywhere, numbers, variant)))
    match = _Match(target=lobe.value(cosines, numbers, variant), cosines=cosines, weight=weight, gain=gain)
    return {name: _nearest(name, match) for name in RENDERERS}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Match:
    target: Floats
    cosines: Cosines
    weight: Floats
    gain: float | None

    def of(self, name: str, log_alpha: float) -> tuple[float, float]:
        """Amplitude and squared relative misfit of one lobe."""
        value = LOBES[name].value(self.cosines, (float(np.exp(log_alpha)),), {"masking": "smith"})
        gain = self._free_gain(value) if self.gain is None else self.gain
        left = np.sum(self.weight * (self.target - gain * value) ** 2)
        return gain, float(left / np.sum(self.weight * self.target**2))

    def _free_gain(self, value: Floats) -> float:
        power = float(np.sum(self.weight * value * value))
        return float(np.sum(self.weight * value * self.target)) / power if power > 0.0 else 0.0


def _nearest(name: str, match: _Match) -> Equivalent:
    from scipy.optimize import minimize_scalar

    grid = np.linspace(np.log(ALPHA[0]), np.log(ALPHA[1]), 80)
    start = int(np.argmin([match.of(name, u)[1] for u in grid]))
    bounds = float(grid[max(start - 1, 0)]), float(grid[min(start + 1, len(grid) - 1)])
    best = float(minimize_scalar(lambda u: match.of(name, u)[1], bounds=bounds, method="bounded").x)
    gain, misfit = match.of(name, best)
    return Equivalent(distribution=name, alpha=float(np.exp(best)), gain=gain, misfit=float(np.sqrt(misfit)))


def _cap(half_angle_rad: float, reach_rad: float) -> tuple[Cosines, Floats]:
    """Normals around the half vector, out to `reach_rad`, and the solid angle that each stands for."""
    polar = (np.arange(240) + 0.5) / 240 * reach_rad
    around = (np.arange(16) + 0.5) / 16 * 2 * np.pi
    t, phi = (a.ravel() for a in np.meshgrid(polar, around))
    normal = np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)
    light = np.array([[np.sin(half_angle_rad), 0.0, np.cos(half_angle_rad)]])
    return Cosines.of(normal, light, light * (-1.0, 1.0, 1.0)), np.sin(t)


def _reach(cosines: Cosines, value: Floats) -> float:
    """How far from the half vector the highlight reaches, rad."""
    seen = value > CORE * value.max()
    return float(np.arcsin(np.sqrt(min(cosines.sin2_h[seen].max(), 1.0)))) * 1.1
