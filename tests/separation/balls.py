"""Photographs of drawn spheres with known layers, for the tests of separation."""

from __future__ import annotations

import numpy as np

from tests.benchmarks.spheres import HUE, WHITE, Picture, gaussian_lobe, ggx_lobe, glossy, turned_from_white
from toolkit.records import ColourLayers
from toolkit.separation import separate

__all__ = ["HUE", "WHITE", "ball", "clip", "ggx_lobe", "layers_of", "noisy", "srgb", "turned_from_white", "unit"]


def ball(sigma: float = 0.2, *, body=HUE, light=WHITE, peak: float = 0.5, lobe=gaussian_lobe, veil=0.0) -> Picture:
    return glossy("ball", lobe(sigma), body=body, light=light, peak=peak, veil=veil)


def noisy(picture: Picture, sd: float, seed: int = 0) -> np.ndarray:
    return picture.radiance + sd * np.random.default_rng(seed).standard_normal(picture.radiance.shape)


def clip(values: np.ndarray, level: float) -> tuple[np.ndarray, np.ndarray]:
    """The picture clipped at a level, and which samples are usable."""
    return np.minimum(values, level), values < level


def layers_of(values: np.ndarray, picture: Picture, sd: float, **options) -> ColourLayers:
    options.setdefault("light_colour", picture.light_colour)
    options.setdefault("variance", np.full(3, sd**2))
    options.setdefault("on_sphere", picture.on_sphere)
    return separate(values, **options)


def srgb(values: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, as a camera's JPEG is encoded."""
    x = np.clip(values, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def unit(colour) -> np.ndarray:
    return np.asarray(colour, float) / np.linalg.norm(colour)


def degrees_between(first, second) -> float:
    return float(np.degrees(np.arccos(np.clip(unit(first) @ unit(second), -1, 1))))
