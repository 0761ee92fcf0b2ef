"""A mosaic's quads brought to one place: colours of a small ball are its own, and their stated error holds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import chi2

from tests.separation.balls import HUE, ball, degrees_between
from toolkit.radiometry.quads import at_one_place, quads
from toolkit.records import ColourLayers, LinearImage, Noise, Plane
from toolkit.separation import separate

RGGB = ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2))
CASES = [(sigma, every, sd) for sigma in (0.1, 0.2) for every in (1, 2, 4) for sd in (0.001, 0.01)]


def mosaic(values: np.ndarray, *, sd: float = 0.0, flagged: tuple[int, int] | None = None) -> LinearImage:
    """A picture (h, w, 3) through a Bayer pattern; `flagged` (row, column) of a red sample that clipped."""
    planes = []
    for row, column, channel in RGGB:
        samples = values[row::2, column::2, channel].astype(np.float32)
        flags = np.zeros(samples.shape, np.uint8)
        if flagged is not None and channel == 0:
            flags[flagged] = 1
        planes.append(
            Plane(channel=channel, values=samples, flags=flags, origin_px=(float(column), float(row)), step_px=2)
        )
    noise = Noise(gain=np.zeros(3), read=np.full(3, sd), source="given")
    height, width = values.shape[:2]
    return LinearImage(
        name="", sha256="", width_px=width, height_px=height, planes=tuple(planes), noise=noise, white=np.inf
    )


def ramp() -> np.ndarray:
    """Brightness that rises to the right and falls downwards, alike in all channels."""
    row, column = np.mgrid[:20, :24]
    return np.repeat((1 + 0.03 * column - 0.02 * row)[..., None], 3, axis=2)


def test_on_a_slope_all_channels_of_a_quad_agree() -> None:
    """A grey ramp is grey in every quad and has the value of the quad's middle; as the samples lie, it is not."""
    image = mosaic(ramp())
    row, column = np.mgrid[:10, :12]
    middle = 1 + 0.03 * (2 * column + 0.5) - 0.02 * (2 * row + 0.5)
    inside = np.s_[1:-1, 1:-1]
    assert np.allclose(_moved(image)[inside], middle[inside][..., None], atol=1e-6)
    assert np.ptp(quads(image).values[inside], axis=-1).min() > 0.009


def test_an_image_of_whole_pixels_stays_as_it_is() -> None:
    """Without a mosaic there is nothing to move."""
    planes = tuple(
        Plane(
            channel=c, values=ramp()[..., c].astype(np.float32), flags=np.zeros((20, 24), np.uint8),
            origin_px=(0.0, 0.0), step_px=1,
        )
        for c in range(3)
    )  # fmt: skip
    noise = Noise(gain=np.zeros(3), read=np.zeros(3), source="given")
    image = LinearImage(name="", sha256="", width_px=24, height_px=20, planes=planes, noise=noise, white=np.inf)
    assert np.array_equal(_moved(image), quads(image).values)


def test_a_clipped_sample_moves_none_of_its_neighbours() -> None:
    """A sample that tells no brightness tells no slope: red around it stays where it is."""
    wild = ramp()
    wild[8, 10, 0] = 50.0
    image = mosaic(wild, flagged=(4, 5))
    near = np.s_[3:6, 4:7, 0]
    assert np.array_equal(_moved(image)[near], quads(image).values[near])
    assert np.allclose(_moved(image)[2, 5], 1 + 0.03 * 10.5 - 0.02 * 4.5, atol=1e-6)


def test_the_move_adds_hardly_any_noise_and_keeps_it_white() -> None:
    """Red's variance grows by a fiftieth, neighbours correlate below 0.05."""
    noise = np.random.default_rng(4).standard_normal((800, 800, 3))
    moved = _moved(mosaic(noise))[1:-1, 1:-1]
    assert moved[..., 0].var() == pytest.approx(1.02, abs=0.02)
    for other in (np.roll(moved, 1, axis=0), np.roll(moved, 1, axis=1)):
        assert abs(np.mean(moved[..., 0] * other[..., 0])) < 0.05


def layers(way: Callable[[LinearImage], np.ndarray], sigma: float, every: int, sd: float) -> ColourLayers:
    """Colour's layers of a ball of 60, 30 or 15 quads' radius."""
    values = ball(sigma).radiance[::every, ::every]
    noise = sd * np.random.default_rng(round(1000 * sigma) + every).standard_normal(values.shape)
    image = mosaic(values + noise, sd=sd)
    row, column = 2 * np.indices((values.shape[0] // 2, values.shape[1] // 2)) + 0.5
    middle = 127.5 / every
    on = np.hypot(row - middle, column - middle) < 120 / every - 4
    return separate(way(image), variance=image.noise, on_sphere=on, light_colour=np.ones(3))


def test_a_small_balls_body_colour_is_off_by_what_it_says() -> None:
    """Twelve mosaics of different size, gloss and noise: z^2 averages 1 as chi-squared allows for twelve."""
    z2 = []
    for case in CASES:
        found = layers(_moved, *case)
        z2.append(np.radians(degrees_between(found.body_colour, HUE)) ** 2 / np.trace(found.body_covariance))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 12) / 12
    assert low < np.mean(z2) < high


@pytest.mark.parametrize("case", [case for case in CASES if case[2] == 0.001])
def test_quads_whose_samples_lie_apart_tilt_the_colour(case: tuple[float, int, float]) -> None:
    """With little noise the body's colour is off by 0.3 to 1.3 degrees as the samples lie, by a tenth of that moved."""
    before, after = (degrees_between(layers(way, *case).body_colour, HUE) for way in (_as_they_lie, _moved))
    assert before > 0.3
    assert after < 0.15 * before


def _moved(image: LinearImage) -> np.ndarray:
    return at_one_place(image, quads(image))


def _as_they_lie(image: LinearImage) -> np.ndarray:
    return quads(image).values
