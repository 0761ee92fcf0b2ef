"""From stored numbers to planes of radiance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toolkit.errors import UsageError
from toolkit.flags import SampleFlag, flagged
from toolkit.radiometry.linearise import linearise
from toolkit.radiometry.quads import quads
from toolkit.records import Noise, RawFrame

NOISE = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1e-3), source="given")
BLACK = np.array([[100.0, 110.0], [120.0, 130.0]])


def mosaic(values, cfa=((0, 1), (1, 2))):
    """A raw frame with four different blacks and white 1100."""
    return RawFrame(
        name="ball.dng",
        sha256="",
        format="raw",
        encoding="linear",
        values=np.asarray(values, np.uint16),
        cfa=np.array(cfa, np.uint8),
        black=BLACK,
        white=np.full((2, 2), 1100.0),
    )


def colours(values, white, kind="png", encoding="linear"):
    """An RGB frame with black at zero."""
    return RawFrame(
        name="ball.png",
        sha256="",
        format=kind,
        encoding=encoding,
        values=values,
        black=np.zeros(3),
        white=np.full(3, white),
    )


def numbers(shape, high=1000):
    """Reproducible integers."""
    return np.random.default_rng(8).integers(0, high, shape)


def test_each_mosaic_position_has_its_own_black():
    """(DN - black) / (white - black) at every position, unclipped below zero."""
    stored = numbers((6, 8))
    stored[:2, :2] = 90  # below every black
    image = linearise(mosaic(stored), noise=NOISE)
    for plane in image.planes:
        column, row = (int(c) for c in plane.origin_px)
        black = BLACK[row, column]
        expected = (stored[row::2, column::2] - black) / (1100 - black)
        assert plane.values == pytest.approx(expected, abs=1e-6)
        assert plane.values.dtype == np.float32
        assert plane.values.min() < 0
    assert [plane.channel for plane in image.planes] == [0, 1, 1, 2]
    assert image.white == 1.0


def test_every_pattern_names_its_channels():
    """Planes follow the pattern: blue first on a BGGR frame."""
    image = linearise(mosaic(numbers((6, 8)), cfa=((2, 1), (1, 0))), noise=NOISE)
    assert [plane.channel for plane in image.planes] == [2, 1, 1, 0]


@pytest.mark.parametrize("box", [(0, 0, 8, 6), (2, 2, 6, 6), (3, 1, 6, 5), (-5, -5, 100, 100), (7, 5, 8, 6)])
def test_a_box_gives_the_same_samples_at_the_same_places(box):
    """Planes of a box are cut from the whole frame's, cells kept whole, the frame's size kept."""
    frame = mosaic(numbers((6, 8)))
    whole, part = linearise(frame, noise=NOISE), linearise(frame, box=box, noise=NOISE)
    assert (part.width_px, part.height_px) == (8, 6)
    for all_of_it, cut in zip(whole.planes, part.planes, strict=True):
        x, y = ((int(c) - int(o)) // 2 for c, o in zip(cut.origin_px, all_of_it.origin_px, strict=True))
        height, width = cut.values.shape
        assert np.array_equal(cut.values, all_of_it.values[y : y + height, x : x + width])
        assert cut.origin_px[0] <= max(box[0], 0) + 1
        assert cut.origin_px[0] + 2 * (width - 1) >= min(box[2], 8) - 2


def test_a_box_outside_the_frame_is_a_usage_error():
    """The message names the box and the frame."""
    with pytest.raises(UsageError, match=r"\(20, 20, 30, 30\).*8 x 6"):
        linearise(mosaic(numbers((6, 8))), box=(20, 20, 30, 30), noise=NOISE)


def test_clipped_samples_and_their_neighbours_are_flagged():
    """A clipped red sample flags its neighbours in the pixels and in its own plane, not further."""
    stored = np.full((12, 12), 500)
    stored[4, 4] = 1100
    image = linearise(mosaic(stored), noise=NOISE)
    flags = np.zeros((12, 12), np.uint8)
    for plane in image.planes:
        column, row = (int(c) for c in plane.origin_px)
        flags[row::2, column::2] = plane.flags
    assert flags[4, 4] == SampleFlag.CLIPPED
    expected = {(4 + dy, 4 + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)}
    expected |= {(4 + dy, 4 + dx) for dy in (-2, 0, 2) for dx in (-2, 0, 2)}
    assert set(zip(*np.nonzero(flags == SampleFlag.BLOOM), strict=True)) == expected - {(4, 4)}


def test_a_raw_counts_as_clipped_a_little_below_white():
    """Saturation scatters: half a percent of the range below white is clipped already, one percent is not."""
    stored = np.full((12, 12), 500)
    stored[2, 2], stored[8, 8] = 1096, 1089
    red = linearise(mosaic(stored), noise=NOISE).planes[0]
    assert red.flags[1, 1] == SampleFlag.CLIPPED
    assert red.flags[4, 4] == 0


@pytest.mark.parametrize("saturation", [0.8, 0.9, 0.97])
def test_a_sensor_that_saturates_below_its_stated_white_is_found(saturation):
    """Samples that pile up at a level below white are clipped there; the brightest unclipped ones are not."""
    rng = np.random.default_rng(9)
    y, x = np.mgrid[0:200, 0:300]
    light = 1.6 * np.exp(-((x - 150) ** 2 + (y - 100) ** 2) / 40**2)
    bright = light > 1.03 * saturation
    stored = 130 + 10_000 * np.minimum(rng.normal(light, 0.003), rng.normal(saturation, 0.0004, light.shape))
    frame = mosaic(np.maximum(stored, 0).round())
    frame = replace(frame, white=np.full((2, 2), 10_130.0))
    flagged = np.zeros(light.shape, bool)
    for plane in linearise(frame, noise=NOISE).planes:
        column, row = (int(c) for c in plane.origin_px)
        flagged[row::2, column::2] = plane.flags == SampleFlag.CLIPPED
    assert flagged[bright].all()
    assert not flagged[light < 0.97 * saturation].any()


def test_twelve_bits_in_a_file_of_sixteen_clip_at_their_own_ceiling():
    """Samples that pile up at 4095 are clipped, though white stays 65535."""
    stored = np.minimum(np.arange(9000).reshape(50, 60, 3), 4095).astype(np.uint16)
    image = linearise(colours(stored, 65_535.0), noise=NOISE)
    assert image.white == 1.0
    assert np.array_equal(image.planes[0].flags == SampleFlag.CLIPPED, stored[..., 0] > 4095 - 0.005 * 65_535)


def test_a_bright_surface_that_does_not_saturate_is_not_clipped():
    """A flat card at nine tenths of white, with its noise, and a small highlight's peak just below white."""
    rng = np.random.default_rng(9)
    y, x = np.mgrid[0:200, 0:300]
    light = np.where(x < 100, 0.9, 0.98 * np.exp(-((x - 200) ** 2 + (y - 100) ** 2) / 30**2))
    stored = 130 + 10_000 * rng.normal(light, 0.002)
    frame = replace(mosaic(np.maximum(stored, 0).round()), white=np.full((2, 2), 10_130.0))
    assert all(not plane.flags.any() for plane in linearise(frame, noise=NOISE).planes)


def test_a_clipped_channel_leaves_the_others_unclipped():
    """Of an RGB pixel whose red clips, green and blue carry the bloom flag only."""
    stored = np.full((9, 9, 3), 30_000, np.uint16)
    stored[4, 4, 0] = 65_535
    image = linearise(colours(stored, 65_535.0), noise=NOISE)
    assert image.planes[0].flags[4, 4] == SampleFlag.CLIPPED
    assert image.planes[1].flags[4, 4] == SampleFlag.BLOOM
    assert np.count_nonzero(image.planes[2].flags) == 9
    assert image.planes[1].values[4, 4] == pytest.approx(30_000 / 65_535, abs=1e-7)


def test_floats_stay_as_stored_and_what_is_no_number_is_flagged():
    """EXR values pass unchanged, above one and below zero; NaN and infinity become flagged zeros."""
    stored = np.random.default_rng(3).normal(1.0, 5.0, (9, 9, 3)).astype(np.float32)
    stored[1, 1, 0], stored[2, 2, 1] = np.nan, np.inf
    image = linearise(colours(stored, np.inf, kind="exr"), noise=NOISE)
    assert image.white == np.inf
    assert image.planes[0].flags[1, 1] == SampleFlag.INVALID
    assert image.planes[1].flags[2, 2] == SampleFlag.INVALID
    assert image.planes[0].values[1, 1] == 0
    assert sum(int(np.count_nonzero(plane.flags)) for plane in image.planes) == 2
    assert np.array_equal(image.planes[2].values, stored[..., 2])


def test_an_encoded_image_needs_its_curve_named():
    """Without a curve it is refused; with sRGB it is linearised exactly and marked."""
    stored = np.arange(192, dtype=np.uint8).reshape(8, 8, 3)
    frame = colours(stored, 255.0, kind="image", encoding="encoded")
    with pytest.raises(UsageError, match="--transfer srgb"):
        linearise(frame, noise=NOISE)
    image = linearise(frame, transfer="srgb", noise=NOISE)
    assert image.transfer_assumed
    encoded = stored[..., 1] / 255
    expected = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    assert image.planes[1].values == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "frame", [mosaic(numbers((8, 8))), colours(np.ones((8, 8, 3), np.float32), np.inf, kind="exr")]
)
def test_a_curve_on_what_is_linear_is_a_usage_error(frame):
    """Raws and float images carry no transfer curve."""
    with pytest.raises(UsageError, match="linear already"):
        linearise(frame, transfer="srgb", noise=NOISE)


def test_quads_average_the_greens_and_join_the_flags():
    """A mosaic's picture: red, mean of greens, blue of each 2 x 2, in the middle of them, flagged where any is."""
    stored = numbers((7, 9))
    stored[0, 1] = 1100
    image = linearise(mosaic(stored), noise=NOISE)
    picture = quads(image)
    assert picture.values.shape == (3, 4, 3)
    assert picture.origin_px == (0.5, 0.5)
    assert picture.step_px == 2
    red, green, other_green, blue = (plane.values[:3, :4] for plane in image.planes)
    assert picture.values[..., 0] == pytest.approx(red)
    assert picture.values[..., 1] == pytest.approx((green + other_green) / 2)
    assert picture.values[..., 2] == pytest.approx(blue)
    assert picture.flags[0, 0] & SampleFlag.CLIPPED


def test_quads_of_a_box_stay_in_place():
    """The picture of a box is cut from the picture of the whole frame."""
    frame = mosaic(numbers((12, 12)))
    whole = quads(linearise(frame, noise=NOISE))
    part = quads(linearise(frame, box=(4, 6, 10, 12), noise=NOISE))
    assert part.origin_px == (4.5, 6.5)
    assert np.array_equal(part.values, whole.values[3:6, 2:5])


def test_an_rgb_image_is_its_own_picture():
    """Three planes of step 1 become one array."""
    stored = np.random.default_rng(1).random((8, 9, 3), np.float32)
    picture = quads(linearise(colours(stored, np.inf, kind="exr"), noise=NOISE))
    assert np.array_equal(picture.values, stored)
    assert picture.step_px == 1


def test_flags_are_told_apart() -> None:
    """Of the kinds asked for at least one."""
    flags = np.array([0, SampleFlag.CLIPPED, SampleFlag.BLOOM, SampleFlag.BLOOM | SampleFlag.INVALID], np.uint8)
    assert flagged(flags, SampleFlag.BLOOM).tolist() == [False, False, True, True]
    assert flagged(flags, SampleFlag.CLIPPED | SampleFlag.INVALID).tolist() == [False, True, False, True]
