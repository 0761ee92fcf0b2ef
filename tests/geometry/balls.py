"""Rendered balls before backgrounds, made by nothing that the detection uses: truth for the outline.

Every pixel is the mean over 6 x 6 rays, blurred by a Gaussian lens, with shot and read noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Camera, Floats, LinearImage, Noise, Plane

FINE = 6
WIDTH, HEIGHT = 320, 280


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One render: the ball's place, the light's angle off the axis, what is behind it, the photograph."""

    truth: Floats  # (3,) centre x, centre y, radius, as in `Sphere`
    light_deg: float
    background: str
    camera: Camera
    image: LinearImage


def case(seed: int, *, background: str = "", light_deg: float | None = None, snr: float = 50.0) -> Case:
    """A random ball: light 0 to 120 degrees off the axis, black, grey or textured behind it, matte to glossy."""
    rng = np.random.default_rng(seed)
    background = background or ("black", "grey", "textured")[seed % 3]
    light_deg = float(rng.uniform(0, 120)) if light_deg is None else light_deg
    radius = float(rng.uniform(40, 110))
    centre = np.array([rng.uniform(radius + 12, side - radius - 12) for side in (WIDTH, HEIGHT)])
    truth = np.array([*centre, radius])
    x, y = _rays()
    turn = rng.uniform(0, 2 * np.pi)
    tilt = np.radians(light_deg)
    light = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])
    nx, ny = (x - centre[0]) / radius, -(y - centre[1]) / radius
    there = nx * nx + ny * ny < 1
    nx, ny = nx[there], ny[there]
    normal = np.stack([nx, ny, np.sqrt(1 - (nx * nx + ny * ny))], axis=-1)
    ball = shade(normal, np.array([0.0, 0.0, 1.0]), light, rng)
    level = float(np.percentile(ball[ball > 0], 95))
    picture = np.array(np.broadcast_to(_background(background, level, rng), there.shape))
    picture[there] = ball
    return Case(
        truth=truth,
        light_deg=light_deg,
        background=background,
        camera=Camera(),
        image=photograph(picture, level=level, snr=snr, blur_px=rng.uniform(0.3, 1.0), mosaic=seed % 2 == 1, rng=rng),
    )


def _rays() -> tuple[Floats, Floats]:
    offset = (np.arange(FINE) + 0.5) / FINE - 0.5
    column = (np.arange(WIDTH)[:, None] + offset).ravel()
    row = (np.arange(HEIGHT)[:, None] + offset).ravel()
    x, y = np.meshgrid(column, row)
    return x, y


def shade(normal: Floats, view: Floats, light: Floats, rng: np.random.Generator) -> Floats:
    """Radiance of a matte ball, or of one under a clear coat (Wolff 1994), with a highlight (Blinn 1977)."""
    nl, nv = np.maximum(normal @ light, 0.0), np.maximum(np.sum(normal * view, axis=-1), 0.0)
    half = light + view
    half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9)
    nh = np.maximum(np.sum(normal * half, axis=-1), 0.0)
    coated = rng.random() < 0.5
    body = nl * (1 - _fresnel(nl)) * (1 - _fresnel(nv)) if coated else nl
    return np.asarray(body + (nl > 0) * rng.uniform(0, 1.5) * nh ** rng.uniform(20, 300))


def _fresnel(cos: Floats, index: float = 1.5) -> Floats:
    inside = np.sqrt(1 - (1 - cos**2) / index**2)
    s = (cos - index * inside) / (cos + index * inside)
    p = (index * cos - inside) / (index * cos + inside)
    return np.asarray(0.5 * (s**2 + p**2))


def _background(kind: str, level: float, rng: np.random.Generator) -> Floats:
    import cv2

    if kind == "black":
        return np.zeros((1, 1))
    grey = level * rng.uniform(0.05, 0.6)
    if kind == "grey":
        return np.full((1, 1), grey)
    pattern = np.zeros((HEIGHT, WIDTH))
    for scale in (1.5, 5.0, 20.0):
        layer = cv2.GaussianBlur(rng.standard_normal((HEIGHT, WIDTH)), (0, 0), scale)
        pattern += layer / layer.std()
    pattern = np.maximum(1 + 0.12 * pattern, 0.1)
    return np.asarray(grey * np.kron(pattern, np.ones((FINE, FINE))))


def photograph(
    picture: Floats, *, level: float, snr: float, blur_px: float, mosaic: bool, rng: np.random.Generator
) -> LinearImage:
    """What a camera records of a finely sampled picture: RGB, or a Bayer mosaic; `snr` where brightness is `level`."""
    import cv2

    blurred = cv2.GaussianBlur(picture, (0, 0), blur_px * FINE)
    mean = cv2.resize(blurred, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    scale = 0.6 / max(level, 1e-9)
    colour = rng.uniform(0.4, 1.0, 3)
    noise = Noise(gain=np.full(3, 0.5 * 0.6 / snr**2), read=np.full(3, np.sqrt(0.5) * 0.6 / snr), source="given")
    planes = []
    places = ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)) if mosaic else ((0, 0, 0), (0, 0, 1), (0, 0, 2))
    step = 2 if mosaic else 1
    for row, column, channel in places:
        clean = scale * colour[channel] / colour.max() * mean[row::step, column::step]
        sd = np.sqrt(noise.gain[channel] * clean + noise.read[channel] ** 2)
        values = np.minimum(clean + sd * rng.standard_normal(clean.shape), 1.0).astype(np.float32)
        flags = (values >= 1.0).astype(np.uint8)
        planes.append(
            Plane(channel=channel, values=values, flags=flags, origin_px=(float(column), float(row)), step_px=step)
        )
    return LinearImage(
        name="ball", sha256="", width_px=WIDTH, height_px=HEIGHT, planes=tuple(planes), noise=noise, white=1.0
    )
