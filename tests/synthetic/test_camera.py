"""The camera's statistics, levels and mosaic."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from synthetic.camera import (
    GOOD_CAMERA,
    Sensor,
    blurred,
    digitise,
    expose,
    exposure_for,
    mosaic,
    noise_profile,
    with_rounding,
)
from synthetic.materials import material
from synthetic.render import Render, render
from synthetic.scenes import sphere_in
from toolkit.records import Noise

GLOSSY = material("torrance-sparrow", {"roughness_rad": 0.2, "diffuse_albedo": (0.6, 0.2, 0.1), "specular_f0": 0.04})
NOISELESS = Noise(gain=np.zeros(3), read=np.zeros(3), source="given")
N = 200_000
LEVELS = (0.0, 1e-4, 1e-3, 0.01, 0.1, 0.8)


def picture(width_px: int = 61, height_px: int = 47, **options: object) -> Render:
    scene = sphere_in(width_px, height_px, radius_px=18.0, offset_px=(1.3, -0.7))
    return render(scene, GLOSSY, width_px=width_px, height_px=height_px, background=np.array([0.03, 0.02, 0.01]))


def worst_p(gain: float, read: float, claimed_gain: float) -> float:
    """Smallest p-value over all levels that mean or variance are what gain and read claim, Sidak-corrected."""
    rng, found = np.random.default_rng(7), []
    for level in LEVELS:
        samples = expose(np.full(N, level), gain=gain, read=read, rng=rng)
        variance = claimed_gain * level + read**2
        z = (samples.mean() - level) / np.sqrt(variance / N)
        excess = 1.0 / (variance / gain) if level else 0.0  # fourth cumulant of Poisson: gain^3 signal
        spread = np.sqrt((2.0 + excess * gain * level / variance) / N)
        found += [2 * stats.norm.sf(abs(z)), 2 * stats.norm.sf(abs(samples.var() / variance - 1.0) / spread)]
    return 1.0 - (1.0 - min(found)) ** len(found)


@pytest.mark.parametrize(("gain", "read"), [(1 / 40_000, 3 / 40_000), (1 / 500, 4 / 500), (1 / 40_000, 1e-2)])
def test_mean_and_variance_follow_the_signal(gain: float, read: float) -> None:
    """Variance is gain x signal + read^2 at every level from black to bright, significance 1e-3."""
    assert worst_p(gain, read, gain) > 1e-3


def test_a_gain_off_by_three_per_cent_would_be_noticed() -> None:
    """The same test refuses a claim of 3 % more shot noise."""
    assert worst_p(1 / 40_000, 3 / 40_000, 1.03 / 40_000) < 1e-3


def test_few_electrons_come_as_whole_numbers() -> None:
    """Shot noise is Poisson, not a normal stand-in: 2 expected electrons arrive as 0, 1, 2 ..., skewed."""
    electrons = expose(np.full(N, 2 / 500), gain=1 / 500, read=0.0, rng=np.random.default_rng(3)) * 500
    counts = np.bincount(np.rint(electrons).astype(int), minlength=9)[:9]
    np.testing.assert_allclose(electrons, np.rint(electrons), atol=1e-9)
    expected = N * stats.poisson.pmf(np.arange(9), 2.0)
    assert stats.chisquare(counts, expected * counts.sum() / expected.sum()).pvalue > 1e-3


def test_levels_round_saturate_and_keep_what_lies_below_black() -> None:
    """0 is the black level, 1 the white; more stays white, negative noise goes below black but not below 0."""
    sensor = Sensor(black_dn=1000, white_dn=11_000)
    found = digitise(np.array([0.0, 1.0, 1.7, -0.05, -0.2, 0.5, 0.12344, 0.12346]), sensor)
    np.testing.assert_array_equal(found, [1000, 11_000, 11_000, 500, 0, 6000, 2234, 2235])


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_each_sample_of_the_mosaic_is_its_own_channel_at_its_own_place(cfa: str) -> None:
    """Without noise the mosaic is the digitised picture, sample by sample, also where width and height are odd."""
    shown, sensor = picture(), Sensor(cfa=cfa)
    found = mosaic(shown, exposure=1.3, noise=NOISELESS, sensor=sensor, rng=np.random.default_rng(0))
    rows, columns = np.indices(found.shape)
    channel = np.array(["RGB".index(c) for c in cfa])[2 * (rows % 2) + columns % 2]
    expected = np.take_along_axis(shown.radiance(), channel[..., None], axis=2)[..., 0]
    np.testing.assert_array_equal(found, digitise(1.3 * expected, sensor))


def test_noise_of_the_mosaic_is_that_of_each_channel() -> None:
    """Residuals over the claimed sd, rounding included, have variance 1 in each channel of unequal noise."""
    noise = Noise(gain=np.array([1e-4, 2e-4, 4e-4]), read=np.array([1e-3, 2e-3, 5e-4]), source="given")
    shown, sensor = picture(400, 300), Sensor(black_dn=100, white_dn=1123)
    dn = mosaic(shown, exposure=1.0, noise=noise, sensor=sensor, rng=np.random.default_rng(5))
    claimed = with_rounding(noise, sensor.step)
    for row, column, channel in sensor.channels:
        expected = shown.radiance()[row::2, column::2, channel]
        measured = (dn[row::2, column::2].astype(float) - 100) * sensor.step
        z = (measured - expected) / np.sqrt(claimed.variance(expected, channel))
        assert abs(z.var() - 1.0) < 4 * np.sqrt(2 / z.size)
        assert abs(z.mean()) < 4 / np.sqrt(z.size)


def test_the_default_sensor_hardly_adds_rounding() -> None:
    """Its steps add less than half a per cent to the variance of a good camera's read noise."""
    rounded = with_rounding(GOOD_CAMERA, Sensor().step)
    np.testing.assert_array_less(rounded.read**2 / GOOD_CAMERA.read**2, 1.005)
    np.testing.assert_allclose(noise_profile(rounded), np.stack([rounded.gain, rounded.read**2], axis=1))


def test_the_exposure_puts_the_highlight_where_it_is_wanted() -> None:
    """The brightest value of any channel, the background included."""
    shown = picture()
    assert exposure_for(shown, highlight=0.8) * shown.radiance().max() == pytest.approx(0.8)
    black = material("phong", {"shininess": 5.0, "diffuse_albedo": 0.0, "specular_albedo": 0.0})
    dark = render(sphere_in(40, 40, radius_px=15.0), black, width_px=40, height_px=40)
    with pytest.raises(ValueError, match="black"):
        exposure_for(dark, highlight=0.8)


def test_blur_keeps_the_light_and_widens_every_layer() -> None:
    """A Gaussian lens moves radiance but loses none, and treats layers and coverage alike."""
    sharp = picture(81, 67)
    soft = blurred(sharp, sd_px=1.5)
    np.testing.assert_allclose(soft.diffuse.sum(axis=(0, 1)), sharp.diffuse.sum(axis=(0, 1)), rtol=1e-6)
    np.testing.assert_allclose(soft.coverage.sum(), sharp.coverage.sum(), rtol=1e-6)
    assert soft.radiance().shape == sharp.radiance().shape
    assert 0.0 < soft.coverage[33, 22] < 0.5  # 1 px outside the outline


def test_the_same_seed_gives_the_same_mosaic() -> None:
    """Another seed gives another."""
    shown = picture()
    first, again, other = (
        mosaic(shown, exposure=1.0, noise=GOOD_CAMERA, sensor=Sensor(), rng=np.random.default_rng(seed))
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.9
