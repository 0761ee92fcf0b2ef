"""Noise from a single photograph, from the file's profile, or as given."""

from __future__ import annotations

import numpy as np
import pytest

from tests import realdata
from tests.radiometry.shaded import bayer_planes, colour_planes, photograph, sphere
from toolkit.io.read import read_in_process
from toolkit.radiometry.linearise import linearise
from toolkit.radiometry.noise import noise_of
from toolkit.radiometry.noise_estimate import estimate
from toolkit.records import Metadata, Noise, Plane

SCENES = {
    "dark": sphere(size=1000, radius=330),
    "grey": sphere(size=1000, radius=330, background=0.2),
    "lit from the side": sphere(size=1000, radius=330, light=(1.0, 0.2, 0.1)),
    "sharp highlight": sphere(size=1000, radius=330, width=0.03),
    "textured background": sphere(size=1000, radius=330, background=0.2, texture=0.5),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(("gain", "read"), [(1 / 40_000, 3 / 40_000), (1e-4, 1e-3), (1e-3, 2e-3)])
def test_gain_and_read_noise_are_found_in_one_mosaic(scene, gain, read):
    """Gain within 5 %, read noise within 15 %, in every channel, on a matte sphere with a highlight."""
    photo = photograph(SCENES[scene], gain, read, np.random.default_rng(11))
    found = estimate(bayer_planes(photo))
    assert found.gain == pytest.approx(gain, rel=0.05)
    assert found.read == pytest.approx(read, rel=0.15)


def test_the_stated_errors_are_those_seen():
    """Over 30 photographs the deviations in units of the stated errors have mean square near one.

    Sidak over six numbers at 1 %: mean squares within 0.38 and 2.01 (chi-square with 30 degrees of freedom).
    """
    radiance = sphere(size=500, radius=170)
    rng = np.random.default_rng(5)
    deviations = []
    for _ in range(30):
        found = estimate(bayer_planes(photograph(radiance, 1e-4, 1e-3, rng)))
        deviations.append(((found.gain - 1e-4) / found.gain_sd, (found.read - 1e-3) / found.read_sd))
    mean_square = np.mean(np.square(deviations), axis=0)
    assert np.all(mean_square > 0.38)
    assert np.all(mean_square < 2.01)


def fractal(size: int, exponent: float, rng: np.random.Generator) -> np.ndarray:
    """A texture (size, size) of unit sd whose amplitudes fall with frequency to the power of `exponent`."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    amplitudes = (
        rng.standard_normal(frequency.shape) + 1j * rng.standard_normal(frequency.shape)
    ) * frequency**-exponent
    texture = np.fft.irfft2(amplitudes, (size, size))
    return np.asarray(texture / texture.std())


def on_texture(size: int, radius: int, exponent: float, brightness: float, seed: int) -> np.ndarray:
    """The ball lit from the side before a background as fine as the lens can show."""
    scene = sphere(size=size, radius=radius, light=(0.8, 0.3, 0.5))
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    around = np.hypot(x, y) > radius + 0.5
    texture = np.clip(brightness * (1 + 0.4 * fractal(size, exponent, np.random.default_rng(seed))), 0.0, None)
    scene[around] = texture[around][:, None] * np.array([1.0, 0.9, 0.8])
    return scene


@pytest.mark.parametrize(("exponent", "brightness"), [(0.3, 0.1), (1.0, 0.15), (1.5, 0.15), (1.0, 0.02)])
@pytest.mark.parametrize(("gain", "read"), [(1 / 40_000, 3 / 40_000), (1e-3, 2e-3)])
def test_a_textured_background_does_not_mislead(exponent, brightness, gain, read):
    """Cloth, wood, foliage around the ball: gain within 5 %, read noise within 15 %, errors that hold.

    Without the disc the finest texture passes for ten times the noise and more, which is what the disc is for.
    """
    size, radius = 900, 200
    photo = photograph(on_texture(size, radius, exponent, brightness, 7), gain, read, np.random.default_rng(8))
    planes, disc = bayer_planes(photo), ((size - 1) / 2, (size - 1) / 2, 0.95 * radius)
    found = estimate(planes, disc=disc)
    assert found.gain == pytest.approx(gain, rel=0.05)
    assert found.read == pytest.approx(read, rel=0.15)
    assert np.all(np.abs(found.gain - gain) < 5 * found.gain_sd)
    assert np.all(np.abs(found.read - read) < 5 * found.read_sd)
    assert exponent > 0.3 or np.all(estimate(planes).gain > 5 * gain)


def test_a_dark_background_tells_what_the_ball_does_not():
    """A ball lit from the front has no dark place; black cloth around it gives the read noise, and joins."""
    size, radius = 700, 250
    scene = sphere(size=size, radius=radius, light=(0.1, 0.1, 1.0))
    planes = bayer_planes(photograph(scene, 1e-4, 1e-3, np.random.default_rng(9)))
    disc = ((size - 1) / 2, (size - 1) / 2, 0.95 * radius)
    found = estimate(planes, disc=disc)
    assert found.read == pytest.approx(1e-3, rel=0.05)
    assert np.all(found.read_sd < 0.05 * 1e-3)
    left, right = int(size / 2 - radius * 0.67), int(size / 2 + radius * 0.67)
    alone = bayer_planes(photograph(scene[left:right, left:right], 1e-4, 1e-3, np.random.default_rng(9)))
    assert np.all(estimate(alone).read_sd > 0.1 * 1e-3)


def test_what_the_photograph_cannot_tell_has_a_large_error():
    """Without a dark place the read noise is uncertain, and said to be."""
    photo = photograph(
        sphere(size=400, radius=140, background=0.3)[170:230, 170:230], 1e-3, 1e-4, np.random.default_rng(3)
    )
    found = estimate(colour_planes(photo))
    assert np.all(found.read_sd > 0.3 * 1e-4)


def test_rounding_is_noise():
    """Steps of 1/255 with dark noise far below them leave at least the rounding's own variance."""
    photo = photograph(SCENES["dark"], 1e-3, 2e-4, np.random.default_rng(4), step=1 / 255)
    found = estimate(bayer_planes(photo))
    assert np.all(found.read >= 0.99 / 255 / np.sqrt(12))
    assert found.gain == pytest.approx(1e-3, rel=0.1)


def test_noise_cut_off_at_black_does_not_mislead():
    """Where negative noise was stored as zero the gain still comes out right."""
    photo = np.maximum(photograph(SCENES["dark"], 1e-4, 1e-3, np.random.default_rng(6), step=1 / 65_535), 0)
    found = estimate(colour_planes(photo))
    assert found.gain == pytest.approx(1e-4, rel=0.05)
    assert found.read == pytest.approx(1e-3, rel=0.25)


def test_a_render_without_noise_keeps_a_tiny_positive_one():
    """A float render's variance is positive and no more than rounding to halves would leave."""
    render = SCENES["dark"].astype(np.float32)
    found = estimate(colour_planes(render))
    assert np.all(found.read > 0)
    assert np.all(found.read < 1e-3 * render.mean())
    assert np.all(found.gain * render.max() < (1e-3 * render.max()) ** 2)


@pytest.mark.parametrize("shape", [(2, 2), (5, 40), (20, 20)])
def test_tiny_planes_still_get_a_positive_noise(shape):
    """Too few samples to tell: positive read noise, infinite error, no failure."""
    values = np.random.default_rng(2).normal(0.5, 0.01, shape).astype(np.float32)
    plane = [
        Plane(channel=c, values=values, flags=np.zeros(shape, np.uint8), origin_px=(0, 0), step_px=1) for c in range(3)
    ]
    found = estimate(plane)
    assert np.all(found.read > 0)
    assert np.all(np.isinf(found.read_sd))


def test_what_is_given_comes_before_the_profile_and_the_profile_before_the_estimate():
    """Given, then DNG NoiseProfile, then estimate; the source says which."""
    planes = colour_planes(np.random.default_rng(1).normal(0.5, 0.01, (40, 40, 3)).astype(np.float32))
    given = Noise(gain=np.ones(3), read=np.ones(3), source="given")
    told = Metadata(noise_profile=((2e-4, 9e-8), (3e-4, 4e-8), (4e-4, 1e-8)))
    assert noise_of(planes, told, given=given) is given
    profile = noise_of(planes, told)
    assert profile.source == "noise_profile"
    assert profile.gain == pytest.approx([2e-4, 3e-4, 4e-4])
    assert profile.read == pytest.approx([3e-4, 2e-4, 1e-4])
    estimated = noise_of(planes, Metadata())
    assert estimated.source == "estimated"
    assert estimated.gain_sd is not None
    assert profile.gain_sd is None
    assert noise_of(planes, Metadata(noise_profile=((2e-4, 9e-8),))).gain == pytest.approx([2e-4] * 3)


def test_one_sensor_has_one_gain_in_all_its_colours():
    """A real mosaic: the three channels, estimated apart, share their amplifier's gain to 3 %."""
    image = linearise(read_in_process(realdata.folder("raw") / "colorchart.dng"))
    assert image.noise.gain == pytest.approx(np.full(3, image.noise.gain.mean()), rel=0.03)


def test_the_ball_photographs_get_sensible_noise():
    """16-bit photographs of the ball: at their dark end the noise is near their own step, in every channel."""
    image = linearise(read_in_process(realdata.folder("diligent_ball") / "001.png"))
    step = 36.7 / 65_535  # what their numbers count in
    assert np.all(image.noise.read > step / np.sqrt(12) * 0.9)
    assert np.all(image.noise.read < 1.5 * step)
    assert np.all(image.noise.gain > 5e-6)
    assert np.all(image.noise.gain < 2e-4)
