"""A shaded sphere and a camera's noise, independent of the project's renderer."""

from __future__ import annotations

import numpy as np

from toolkit.records import Plane


def sphere(*, size=600, radius=200, light=(0.4, 0.3, 0.85), background=0.0, texture=0.0, width=0.1):
    """Radiance (size, size, 3) of a matte sphere with a soft highlight, 2 x 2 supersampled."""
    fine = (np.arange(2 * size) + 0.5) / 2 - 0.5
    x, y = np.meshgrid((fine - size / 2) / radius, -(fine - size / 2) / radius)
    on = x * x + y * y < 1
    z = np.sqrt(np.clip(1 - x * x - y * y, 0, 1))
    towards = np.array(light) / np.linalg.norm(light)
    half = towards + np.array([0, 0, 1])
    half /= np.linalg.norm(half)
    cosine = np.clip(x * towards[0] + y * towards[1] + z * towards[2], 0, None)
    angle = np.arccos(np.clip(x * half[0] + y * half[1] + z * half[2], -1, 1))
    highlight = 0.3 * np.exp(-(angle**2) / (2 * width**2)) * (cosine > 0)
    behind = background * (1 + texture * np.sin(x * radius / 2.1) * np.sin(y * radius / 1.7))
    channels = [np.where(on, albedo * cosine + highlight, behind) for albedo in (0.4, 0.25, 0.15)]
    return np.stack([c.reshape(size, 2, size, 2).mean((1, 3)) for c in channels], axis=-1)


def photograph(radiance, gain, read, rng, *, step=0.0):
    """Poisson and Gaussian noise, rounding to `step`, clipping at 1; float32."""
    noisy = rng.poisson(radiance / gain) * gain + read * rng.standard_normal(radiance.shape)
    rounded = np.round(noisy / step) * step if step else noisy
    return np.minimum(rounded, 1.0).astype(np.float32)


def bayer_planes(rgb):
    """Four planes of step 2, red green / green blue."""
    places = ((0, 0, 0), (1, 0, 1), (1, 1, 0), (2, 1, 1))
    return tuple(_plane(c, rgb[row::2, column::2, c], (column, row), 2) for c, row, column in places)


def colour_planes(rgb):
    """Three planes of step 1."""
    return tuple(_plane(c, rgb[..., c], (0, 0), 1) for c in range(3))


def _plane(channel, values, origin, step):
    flags = (values >= 1.0).astype(np.uint8)
    return Plane(channel=channel, values=np.ascontiguousarray(values), flags=flags, origin_px=origin, step_px=step)
