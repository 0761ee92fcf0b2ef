"""Where in each profile the limb lies: a shaded sphere's edge, blurred, against any background.

Just inside the limb of a sphere of radius R, at depth u R, a Lambertian surface has n.l = l_r (1 - u) +
l_z sqrt(2u - u^2), with l_r and l_z the light's parts along the limb's normal and towards the camera. So the model of
a profile is level and slope outside, and level, slope and that square root inside, all linear; only the place of the
edge and the blur are not. A step alone would be drawn inwards by the darkening towards the limb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .profiles import Profiles

COLUMNS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgePlaces:
    """The limb's depth in each segment, in samples, with its sd; `evidence` is the drop of chi-square against no edge."""

    depth: Floats  # (segments,)
    sd: Floats  # (segments,)
    evidence: Floats  # (segments,)
    chi2: Floats  # (segments,), per degree of freedom at the best place
    step: Floats  # (segments,), jump of brightness over its sd, the largest over the channels

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weighing:
    """What the edge's model needs to know of the ball and the picture."""

    radius: float  # samples
    blur: float  # sd of the edge's blur in samples, the sample's own area included
    level: Floats  # (channels,), brightness that the ball's lit part reaches
    gain: Floats  # (channels,)
    read: Floats  # (channels,)

    def __post_init__(self) -> None:
        readonly(self)


def _table(radius: float, blur: float, reach: float) -> tuple[Floats, Floats]:
    """Depths, and the square-root profile blurred by a Gaussian, on a fine grid of depths."""
    fine = 1.0 / 16.0
    x = np.arange(-reach, reach + fine / 2, fine)
    u = np.maximum(x, 0.0) / radius
    sharp = np.sqrt(np.maximum(2.0 * u - u * u, 0.0))
    k = np.arange(-np.ceil(5 * blur / fine), np.ceil(5 * blur / fine) + 1) * fine
    kernel = np.exp(-0.5 * (k / blur) ** 2)
    padded = np.concatenate([np.zeros(len(k) // 2), sharp, np.full(len(k) // 2, sharp[-1])])
    return x, np.convolve(padded, kernel / kernel.sum(), mode="valid")


def columns(depth: Floats, weighing: Weighing, table: tuple[Floats, Floats]) -> Floats:
    """Design (..., 5) at depths below the edge: level and slope outside, level, square root and slope inside."""
    from scipy.special import ndtr

    b, r = weighing.blur, weighing.radius
    step = ndtr(depth / b)
    ramp = depth * step + b * np.exp(-0.5 * (depth / b) ** 2) / np.sqrt(2 * np.pi)
    root = np.interp(depth, *table)
    return np.stack([1.0 - step, (depth - ramp) / 8.0, step, root, ramp / r], axis=-1)


def edge_costs(profiles: Profiles, weighing: Weighing, offsets: Floats) -> tuple[Floats, Floats]:
    """Chi-square (segments, offsets) of an edge at each depth, and its jump over its sd, the channels' largest."""
    reach = float(np.abs(profiles.depth).max() + np.abs(offsets).max() + 1.0)
    table = _table(weighing.radius, weighing.blur, reach)
    cost, jump = np.zeros((profiles.depth.shape[1], len(offsets))), np.zeros((profiles.depth.shape[1], len(offsets)))
    for c in range(len(profiles.value)):
        weight = _weights(profiles, c, weighing)
        design = columns(profiles.depth[c][:, None, :] - offsets[:, None], weighing, table)
        one, step = _least_squares(design, profiles.value[c], weight, _prior(weighing, c))
        cost += one
        jump = np.maximum(jump, step)
    return cost, jump


def _weights(profiles: Profiles, c: int, weighing: Weighing) -> Floats:
    """Inverse variances of the bins' means, from the brightness smoothed over depth."""
    value, count = profiles.value[c], profiles.count[c]
    kernel = np.ones(9)
    smooth = np.stack([np.convolve(v * n, kernel, "same") for v, n in zip(value, count, strict=True)])
    smooth /= np.maximum(np.stack([np.convolve(n, kernel, "same") for n in count]), 1.0)
    return np.asarray(count / (weighing.gain[c] * np.maximum(smooth, 0.0) + weighing.read[c] ** 2))


def _prior(weighing: Weighing, c: int) -> Floats:
    """Inverse prior variances of the five coefficients, by what a ball of this brightness can show."""
    level = max(float(weighing.level[c]), 3.0 * float(weighing.read[c]))
    return np.asarray(1.0 / (level * np.array([10.0, 0.5, 10.0, 2.0, 3.0])) ** 2)


def _least_squares(design: Floats, value: Floats, weight: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Chi-square (segments, offsets) with the prior's share, and the jump of level over its sd."""
    weighted = design * weight[:, None, :, None]
    normal = np.swapaxes(weighted, -1, -2) @ design + np.diag(prior)
    right = np.einsum("kgbi,kb->kgi", weighted, value, optimize=True)
    inverse = np.linalg.inv(normal)
    best = np.einsum("kgij,kgj->kgi", inverse, right)
    cost = np.einsum("kb,kb->k", weight * value, value)[:, None] - np.einsum("kgi,kgi->kg", best, right)
    pick = np.array([-1.0, 0.0, 1.0, 0.0, 0.0])
    variance = np.einsum("i,kgij,j->kg", pick, inverse, pick)
    return cost, np.abs(best @ pick) / np.sqrt(np.maximum(variance, 1e-30))


def no_edge(profiles: Profiles, weighing: Weighing) -> Floats:
    """Chi-square (segments,) of a smooth profile, a quadratic in depth, where there is no edge at all."""
    cost = np.zeros(profiles.depth.shape[1])
    for c in range(len(profiles.value)):
        x = profiles.depth[c] / max(float(np.abs(profiles.depth).max()), 1e-9)
        design = np.stack([np.ones_like(x), x, x * x], axis=-1)[:, None]
        weight = _weights(profiles, c, weighing)
        cost += _least_squares_plain(design, profiles.value[c], weight)
    return cost


def _least_squares_plain(design: Floats, value: Floats, weight: Floats) -> Floats:
    weighted = design[:, 0] * weight[..., None]
    normal = np.swapaxes(weighted, -1, -2) @ design[:, 0] + 1e-9 * np.eye(3)
    right = np.einsum("kbi,kb->ki", weighted, value)
    best = np.linalg.solve(normal, right[..., None])[..., 0]
    return np.asarray(np.einsum("kb,kb->k", weight * value, value) - np.einsum("ki,ki->k", best, right))


def edge_places(profiles: Profiles, weighing: Weighing, *, search: float) -> EdgePlaces:
    """The best place of the limb in each segment, within `search` samples of where it was thought to be."""
    offsets = np.arange(-search, search + 1e-9, 0.25)
    cost, jump = edge_costs(profiles, weighing, offsets)
    filled = np.count_nonzero(profiles.count > 0, axis=(0, 2))
    freedom = np.maximum(filled - COLUMNS * len(profiles.value), 1)
    best = np.argmin(cost, axis=1)
    at = np.clip(best, 1, len(offsets) - 2)
    rows = np.arange(len(at))
    low, mid, high = (cost[rows, at + k] for k in (-1, 0, 1))
    curvature = np.maximum(low - 2 * mid + high, 1e-9)
    depth = offsets[at] + 0.25 * np.clip(0.5 * (low - high) / curvature, -1.0, 1.0)
    chi2 = cost[rows, best] / freedom
    inflation = np.maximum(chi2, 1.0)
    evidence = (no_edge(profiles, weighing) - cost[rows, best]) / inflation
    at_end = (best == 0) | (best == len(offsets) - 1)
    sd = np.where(at_end, np.inf, np.sqrt(2.0 * 0.25**2 / curvature * inflation))
    return EdgePlaces(depth=depth, sd=sd, evidence=evidence, chi2=chi2, step=jump[rows, best] / np.sqrt(inflation))
