"""How layers are judged: a photograph of known layers, PSNR and relative rms by scikit-image, the limit by theory."""

from __future__ import annotations

import numpy as np
from skimage.metrics import normalized_root_mse, peak_signal_noise_ratio

from tests.benchmarks.spheres import Picture

NOISE = 0.01
SEED = 20
Layers = tuple[np.ndarray, np.ndarray]


def photograph(truth: Picture, noise: float) -> tuple[np.ndarray, float, np.ndarray]:
    """The noisy picture, the sd of its samples and which of them are usable."""
    values = truth.radiance + noise * np.random.default_rng(SEED).standard_normal(truth.radiance.shape)
    usable = values < truth.clip
    sd = noise
    if truth.levels:
        values = np.round(np.clip(values, 0, 1) * truth.levels) / truth.levels
        sd = float(np.hypot(noise, 1 / truth.levels / np.sqrt(12)))
    return np.minimum(values, truth.clip), sd, usable


def limit(truth: Picture, sd: float) -> tuple[float, float]:
    """PSNR and relative rms that no unbiased split of single pixels beats; (0, inf) where colour tells nothing."""
    on = truth.on_sphere
    body = truth.diffuse[on].sum(axis=0)
    body, light = body / np.linalg.norm(body), truth.light_colour / np.linalg.norm(truth.light_colour)
    sin2 = 1 - float(body @ light) ** 2
    if sin2 < 1e-9:
        return 0.0, np.inf
    if sd == 0:
        return np.inf, 0.0
    mse = sd**2 / sin2 / 3
    peak, power = truth.diffuse[on].max(), np.mean(truth.specular[on] ** 2)
    return float(10 * np.log10(peak**2 / mse)), float(np.sqrt(mse / power))


def score(truth: Picture, layers: Layers) -> tuple[float, float]:
    """PSNR of the diffuse layer, dB, and relative rms error of the specular one; NaN where a layer says nothing."""
    on = truth.on_sphere
    if not all(np.all(np.isfinite(layer[on])) for layer in layers):
        return np.nan, np.nan
    true, found = truth.diffuse[on], np.asarray(layers[0], float)[on]
    with np.errstate(divide="ignore"):
        psnr = peak_signal_noise_ratio(true, found, data_range=float(true.max()))
    return float(psnr), float(normalized_root_mse(truth.specular[on], np.asarray(layers[1], float)[on]))
