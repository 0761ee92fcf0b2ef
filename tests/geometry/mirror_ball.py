"""Photographs of a mirror ball by a ray tracer of its own: view rays, a quadratic, a reflection, a disc of light.

Nothing here comes from the project but the record that holds a photograph.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.flags import SampleFlag
from toolkit.records import LinearImage, Noise, Plane

NOISE = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1e-3), source="given")
FINE = 6  # parts of a pixel's side
Balls = list[tuple[float, float, float]]


def traced(
    balls: Balls,
    lamp: Any,
    *,
    lamp_radius: float,
    size: tuple[int, int],
    focal_px: float | None = None,
    blur_px: float = 0.7,
    box: int = 60,
) -> Any:
    """Radiance (h, w), 0 to 1, of balls (centre x, y, z in scene units, unit radius) and a lamp that is a sphere.

    Perspective: the camera at the origin looks along -z, x right, y up, the principal point in the frame's middle.
    Orthographic (no focal length): x, y are in units of 100 pixels. Only boxes round the highlights are traced.
    """
    from scipy.ndimage import gaussian_filter

    height, width = size
    picture = np.zeros((height, width))
    for ball in balls:
        x0, y0 = _rough(np.asarray(ball), np.asarray(lamp), size, focal_px)
        corner = max(x0 - box // 2, 0), max(y0 - box // 2, 0)
        shape = min(box, height - corner[1]), min(box, width - corner[0])
        fine = [(np.arange(n * FINE) + 0.5) / FINE - 0.5 + c for n, c in zip(shape, corner[::-1], strict=True)]
        y, x = np.meshgrid(*fine, indexing="ij")
        origin, ray = _view(x, y, size, focal_px)
        seen = _lit(origin, ray, np.asarray(ball), np.asarray(lamp), lamp_radius)
        seen = gaussian_filter(seen, blur_px * FINE)
        pixels = seen.reshape(shape[0], FINE, shape[1], FINE).mean(axis=(1, 3))
        picture[corner[1] : corner[1] + shape[0], corner[0] : corner[0] + shape[1]] += pixels
    return picture


def _view(x: Any, y: Any, size: tuple[int, int], focal_px: float | None) -> tuple[Any, Any]:
    right, up = x - (size[1] - 1) / 2, (size[0] - 1) / 2 - y
    if focal_px is None:
        origin = np.stack([right / 100, up / 100, np.full_like(x, 1e4)], axis=-1)
        return origin, np.broadcast_to([0.0, 0.0, -1.0], origin.shape)
    ray = np.stack([right, up, np.full_like(x, -focal_px)], axis=-1)
    return np.zeros_like(ray), ray / np.linalg.norm(ray, axis=-1, keepdims=True)


def _lit(origin: Any, ray: Any, ball: Any, lamp: Any, lamp_radius: float) -> Any:
    """1 where the reflected ray meets the lamp."""
    away = origin - ball
    b = np.sum(away * ray, axis=-1)
    root = b * b - np.sum(away * away, axis=-1) + 1.0
    point = origin + (-b - np.sqrt(np.maximum(root, 0.0)))[..., None] * ray
    normal = point - ball
    out = ray - 2 * np.sum(ray * normal, axis=-1, keepdims=True) * normal
    to_lamp = lamp - point
    along = np.sum(to_lamp * out, axis=-1)
    past = np.sqrt(np.maximum(np.sum(to_lamp * to_lamp, axis=-1) - along**2, 0.0))
    return np.where((root > 0) & (along > 0) & (past < lamp_radius), 1.0, 0.0)


def _rough(ball: Any, lamp: Any, size: tuple[int, int], focal_px: float | None) -> tuple[int, int]:
    """The pixel near which the ball shows the lamp: where view and lamp, halved, meet the surface."""
    towards = (lamp - ball) / np.linalg.norm(lamp - ball)
    view = np.array([0.0, 0.0, 1.0]) if focal_px is None else -ball / np.linalg.norm(ball)
    half = (towards + view) / np.linalg.norm(towards + view)
    x, y, z = ball + half
    scale = 100.0 if focal_px is None else focal_px / -z
    return round(x * scale + (size[1] - 1) / 2), round((size[0] - 1) / 2 - y * scale)


def photographed(signal: Any, *, seed: int, white: float = 1.0, mosaic: bool = False) -> LinearImage:
    """A noisy photograph that clips at `white`: three planes, or the four of a Bayer mosaic."""
    from scipy.ndimage import binary_dilation

    rng = np.random.default_rng(seed)
    planes = []
    sites = [(0, 0, 0), (1, 0, 1), (1, 1, 0), (2, 1, 1)] if mosaic else [(0, 0, 0), (1, 0, 0), (2, 0, 0)]
    step = 2 if mosaic else 1
    for channel, row, column in sites:
        part = signal[row::step, column::step]
        sd = np.sqrt(NOISE.gain[channel] * np.maximum(part, 0.0) + NOISE.read[channel] ** 2)
        noisy = part + sd * rng.standard_normal(part.shape)
        clipped = noisy >= white
        beside = binary_dilation(clipped, np.ones((3, 3))) & ~clipped
        flags = np.uint8(SampleFlag.CLIPPED) * clipped + np.uint8(SampleFlag.BLOOM) * beside
        planes.append(
            Plane(
                channel=channel,
                values=np.minimum(noisy, white).astype(np.float32),
                flags=flags.astype(np.uint8),
                origin_px=(float(column), float(row)),
                step_px=step,
            )
        )
    return LinearImage(
        name="traced",
        sha256="",
        width_px=signal.shape[1],
        height_px=signal.shape[0],
        planes=tuple(planes),
        noise=NOISE,
        white=white,
    )
