"""A camera: exposure, blur, shot and read noise, saturation, black level and quantisation of an ideal picture.

Image units: 0 is black, 1 the level of saturation. Shot noise is Poisson in electrons, read noise Gaussian, so a
sample's variance is gain x signal + read^2 exactly, with 1 / gain the electrons at saturation.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.io.dng import Cfa
from toolkit.records import Floats, Noise, readonly

from .render import Render

_STEPS_PER_ELECTRON = 1024.0  # expected electrons are rounded to this, so that no processor's last bit moves a draw


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensor:
    """A sensor of 16 bits with levels so fine that their rounding adds 0.4 % to a read noise of 3/40000."""

    cfa: Cfa = "RGGB"
    black_dn: int = 1024
    white_dn: int = 65000
    # ColorMatrix1 of a typical full-frame camera under D65, and its response to grey there
    xyz_to_camera: Floats = field(
        default_factory=lambda: np.array([[0.69, -0.19, -0.06], [-0.45, 1.24, 0.23], [-0.08, 0.21, 0.56]])
    )
    as_shot_neutral: Floats = field(default_factory=lambda: np.array([0.48, 1.0, 0.65]))

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def step(self) -> float:
        """One DN in image units."""
        return 1.0 / (self.white_dn - self.black_dn)

    @property
    def channels(self) -> tuple[tuple[int, int, int], ...]:
        """Row, column and channel of the four samples of a quad."""
        return tuple((i // 2, i % 2, "RGB".index(colour)) for i, colour in enumerate(self.cfa))


GOOD_CAMERA = Noise(gain=np.full(3, 1 / 40_000), read=np.full(3, 3 / 40_000), source="given")  # 40,000 e-, 3 e-


def exposure_for(render: Render, *, highlight: float) -> float:
    """The factor on radiance that puts the picture's brightest value at `highlight` of saturation."""
    brightest = float(max(render.box_radiance().max(), (render.background + render.pedestal).max()))
    if brightest <= 0.0:
        raise ValueError("the picture is black; expected light on the sphere")
    return highlight / brightest


def blurred(render: Render, *, sd_px: float) -> Render:
    """The picture through a lens whose point spread is Gaussian."""
    from scipy.ndimage import gaussian_filter

    def soften(layer: Floats) -> Floats:
        sds = (sd_px, sd_px, 0.0)[: layer.ndim]
        return np.asarray(gaussian_filter(layer, sds, mode="nearest"))

    diffuse, specular = soften(render.full(render.diffuse)), soften(render.full(render.specular))
    coverage = soften(render.full(render.coverage[..., None])[..., 0])
    return replace(render, origin_px=(0, 0), diffuse=diffuse, specular=specular, coverage=coverage)


def with_rays(render: Render, *, angle_deg: float, share: float, length_px: int) -> Render:
    """The picture through a lens that draws each point out into two opposite rays, as an iris's straight edges do.

    They take `share` of the light, fall off with the square of the distance, and end at `length_px`; `angle_deg` is
    anticlockwise from the right.
    """
    from scipy.signal import fftconvolve

    turn, kernel = np.radians(angle_deg), np.zeros((2 * length_px + 3, 2 * length_px + 3))
    for along in np.concatenate([np.arange(-length_px, -0.9, 0.1), np.arange(1.0, length_px + 0.1, 0.1)]):
        x, y = length_px + 1 + along * np.cos(turn), length_px + 1 - along * np.sin(turn)
        column, row = int(x), int(y)
        across, down = np.array([column + 1 - x, x - column]), np.array([row + 1 - y, y - row])
        kernel[row : row + 2, column : column + 2] += np.outer(down, across) / along**2
    kernel *= share / kernel.sum()

    def drawn_out(layer: Floats) -> Floats:
        full = render.full(layer)
        return (1.0 - share) * full + np.maximum(fftconvolve(full, kernel[..., None], mode="same", axes=(0, 1)), 0.0)

    coverage = render.full(render.coverage[..., None])[..., 0]
    diffuse, specular = drawn_out(render.diffuse), drawn_out(render.specular)
    return replace(render, origin_px=(0, 0), diffuse=diffuse, specular=specular, coverage=coverage)


def mosaic(
    render: Render, *, exposure: float, noise: Noise, sensor: Sensor, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """The raw samples (H, W) of one photograph, DN."""
    radiance, around = render.box_radiance(), render.background + render.pedestal
    result = np.empty((render.height_px, render.width_px), np.uint16)
    x0, y0 = render.origin_px
    for row, column, channel in sensor.channels:
        signal = np.full(result.shape, around[channel])[row::2, column::2]
        first_row, first_column = (row - y0) % 2, (column - x0) % 2
        top, left = (y0 + first_row) // 2, (x0 + first_column) // 2
        inside = radiance[first_row::2, first_column::2, channel]
        signal[top : top + inside.shape[0], left : left + inside.shape[1]] = inside
        measured = expose(exposure * signal, gain=noise.gain[channel], read=noise.read[channel], rng=rng)
        result[row::2, column::2] = digitise(measured, sensor)
    return result


def expose(signal: Floats, *, gain: float, read: float, rng: np.random.Generator) -> Floats:
    """Noisy samples of an expected signal, image units, not yet saturated; gain 0 is without shot noise."""
    if gain > 0.0:
        electrons = np.rint(signal * (_STEPS_PER_ELECTRON / gain)) / _STEPS_PER_ELECTRON
        signal = rng.poisson(electrons) * gain
    return np.asarray(signal + read * rng.standard_normal(signal.shape))


def digitise(signal: Floats, sensor: Sensor) -> NDArray[np.uint16]:
    """DN of a signal in image units: saturated at white, nothing below 0 DN."""
    levels = sensor.black_dn + signal * (sensor.white_dn - sensor.black_dn)
    return np.rint(np.clip(levels, 0, sensor.white_dn)).astype(np.uint16)


def with_rounding(noise: Noise, step: float) -> Noise:
    """The noise of samples rounded to multiples of `step`: its variance step^2 / 12 joins the read noise."""
    return Noise(gain=noise.gain, read=np.sqrt(noise.read**2 + step**2 / 12.0), source=noise.source)


def noise_profile(noise: Noise) -> Floats:
    """DNG's NoiseProfile (3, 2): scale and offset of each channel's variance."""
    return np.stack([noise.gain, noise.read**2], axis=1)
