"""Where the laws look: every variant of a lobe, every corner of its box, directions down to grazing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance import Cosines, Lobe, Parameter

UP = np.array([0.0, 0.0, 1.0])


def variants(lobe: Lobe) -> list[dict[str, str]]:
    """Every combination of the lobe's options."""
    return [dict(zip(lobe.variants, choice, strict=True)) for choice in product(*lobe.variants.values())]


def inside(parameter: Parameter, share: float) -> float:
    """The value at a share of the way through a parameter's range, in its logarithm where it is searched so."""
    if parameter.log:
        return float(parameter.low * (parameter.high / parameter.low) ** share)
    return float(parameter.low + (parameter.high - parameter.low) * share)


def shapes(lobe: Lobe, shares: tuple[float, ...] = (0.0, 0.5, 1.0)) -> list[tuple[float, ...]]:
    """The corners of the lobe's box, and the middles between them."""
    return list(product(*([inside(p, share) for share in shares] for p in lobe.parameters)))


def cases(lobe: Lobe) -> Iterator[tuple[dict[str, str], tuple[float, ...]]]:
    """Every variant at every corner."""
    return iter(product(variants(lobe), shapes(lobe)))


def direction(polar_rad: Floats | float, azimuth_rad: Floats | float) -> Floats:
    """Unit vectors at angles from `UP`."""
    polar, azimuth = np.broadcast_arrays(np.asarray(polar_rad, float), np.asarray(azimuth_rad, float))
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)


def around(count: int, seed: int = 20) -> tuple[Floats, Floats]:
    """Pairs of directions of light and view: anywhere on the hemisphere, near each other's mirror image, grazing."""
    rng = np.random.default_rng(seed)
    light = direction(np.arccos(rng.uniform(0.0, 1.0, count)), rng.uniform(0.0, 2 * np.pi, count))
    view = direction(np.arccos(rng.uniform(0.0, 1.0, count)), rng.uniform(0.0, 2 * np.pi, count))
    near = light * [-1.0, -1.0, 1.0] + rng.normal(size=light.shape) * 10.0 ** rng.uniform(-4.0, -0.5, (count, 1))
    near[:, 2] = np.abs(near[:, 2])
    near /= np.linalg.norm(near, axis=1, keepdims=True)
    return np.concatenate([light, light]), np.concatenate([view, near])


def extremes() -> tuple[Floats, Floats]:
    """Every pairing of directions at and near the normal, the horizon and below it."""
    polar = np.array([0.0, 1e-9, 0.7, np.pi / 2 - 1e-3, np.pi / 2 - 1e-9, np.pi / 2, np.pi / 2 + 1e-9, 2.0, np.pi])
    all_of_them = direction(*(a.ravel() for a in np.meshgrid(polar, np.array([0.0, 1.0, np.pi]))))
    n = len(all_of_them)
    return np.repeat(all_of_them, n, axis=0), np.tile(all_of_them, (n, 1))


def seen(light: Floats, view: Floats, source_radius_rad: float = 0.0) -> Cosines:
    """Cosines on a surface that faces up."""
    return Cosines.of(UP, light, view, source_radius_rad=source_radius_rad)
