"""Separation by colour alone: laws, statistics with negative controls, and what it refuses or flags."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2
from skimage.metrics import normalized_root_mse, peak_signal_noise_ratio

from tests import realdata
from tests.benchmarks.separation import limit
from tests.separation.balls import (
    HUE,
    ball,
    clip,
    degrees_between,
    ggx_lobe,
    layers_of,
    noisy,
    srgb,
    turned_from_white,
    unit,
)
from toolkit.errors import BadInputError
from toolkit.flags import Flag
from toolkit.records import Noise
from toolkit.separation import separate

SD = 0.01


def psnr(found: np.ndarray, truth: np.ndarray, on: np.ndarray) -> float:
    return float(peak_signal_noise_ratio(truth[on], np.asarray(found, float)[on], data_range=truth[on].max()))


# --- laws ------------------------------------------------------------------------------------------------------


def test_the_layers_and_the_residual_add_up_to_the_picture() -> None:
    """Diffuse + specular + residual across the plane is the photograph, sample by sample."""
    picture = ball()
    values = noisy(picture, SD)
    found = layers_of(values, picture, SD)
    across = unit(np.cross(found.body_colour, found.light_colour))
    total = found.diffuse + found.specular + found.residual[..., None] * across
    assert np.abs(total - values)[picture.on_sphere].max() < 1e-6
    assert np.isnan(found.diffuse[~picture.on_sphere]).all()


@pytest.mark.parametrize("factor", [1e-9, 0.37, 2.0**40])
def test_brighter_light_scales_the_layers_and_nothing_else(factor: float) -> None:
    """Layers go with the picture's units, however odd; colours and angle stay."""
    picture = ball()
    values = noisy(picture, SD)
    one, other = layers_of(values, picture, SD), layers_of(values * factor, picture, SD * factor)
    on = picture.on_sphere
    assert np.allclose(other.diffuse[on], one.diffuse[on] * factor, rtol=1e-4, atol=1e-5 * factor)
    assert np.allclose(other.covariance[on], one.covariance[on] * factor**2, rtol=1e-3)
    assert degrees_between(one.body_colour, other.body_colour) < 1e-3
    assert other.flags == one.flags


def test_the_order_of_the_channels_does_not_matter() -> None:
    """Red, green, blue swapped about give the same layers swapped about."""
    picture, order = ball(light=(1.0, 0.8, 0.6)), [2, 0, 1]
    values = noisy(picture, SD)
    straight = layers_of(values, picture, SD)
    swapped = layers_of(values[..., order], picture, SD, light_colour=picture.light_colour[order])
    assert np.allclose(swapped.diffuse, straight.diffuse[..., order], atol=1e-5, equal_nan=True)


def test_more_highlight_changes_the_specular_layer_only() -> None:
    """A second highlight where there is one already leaves the diffuse layer as it was."""
    picture = ball(peak=0.4)
    values = noisy(picture, SD)
    more = values + 0.7 * picture.specular
    one, other = layers_of(values, picture, SD), layers_of(more, picture, SD)
    on = picture.on_sphere
    assert np.abs(one.diffuse - other.diffuse)[on].max() < 5e-3
    assert normalized_root_mse(0.7 * picture.specular[on], (other.specular - one.specular)[on]) < 0.02


# --- figures ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
def test_a_clean_picture_is_separated_to_ninety_decibels(sigma: float) -> None:
    """Without noise the diffuse layer is exact but for the highlight's tail."""
    picture = ball(sigma, peak=0.95)
    assert psnr(layers_of(picture.radiance, picture, 0.0).diffuse, picture.diffuse, picture.on_sphere) > 90


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_noisy_picture_is_separated_within_0_4_db_of_the_bound(sigma: float, seed: int) -> None:
    """Not knowing the body colour costs less than 0.4 dB of what knowing both colours allows."""
    picture = ball(sigma, peak=0.95)
    found = layers_of(noisy(picture, SD, seed), picture, SD)
    assert psnr(found.diffuse, picture.diffuse, picture.on_sphere) > limit(picture, SD)[0] - 0.4


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("told_sd", [1 / 4095 / np.sqrt(12), 0.0])
def test_twelve_bits_stay_within_one_decibel_of_the_bound(sigma: float, told_sd: float) -> None:
    """Quantised values are separated as well as their rounding allows, whether or not the rounding is told."""
    picture = ball(sigma, body=tuple(0.58 * np.array(HUE)), peak=0.55)
    values = np.round(picture.radiance * 4095) / 4095
    found = layers_of(values, picture, told_sd)
    bound = limit(picture, 1 / 4095 / np.sqrt(12))[0]
    assert psnr(found.diffuse, picture.diffuse, picture.on_sphere) > bound - 1


# --- statistics --------------------------------------------------------------------------------------------------


def mean_square_z(found, picture, factor: float = 1.0) -> tuple[float, float]:
    """Of both coefficients against their own variance times `factor`, over the sphere."""
    on = picture.on_sphere
    body, light = (picture.diffuse @ found.body_colour)[on], (picture.specular @ found.light_colour)[on]
    a, s = (found.diffuse @ found.body_colour)[on], (found.specular @ found.light_colour)[on]
    variance = factor * found.covariance[on]
    return float(np.mean((a - body) ** 2 / variance[:, 0])), float(np.mean((s - light) ** 2 / variance[:, 2]))


def test_the_stated_covariance_is_the_error() -> None:
    """Mean z^2 of 45,000 pixels is 1 within six of its sds."""
    picture = ball(0.15)
    found = layers_of(noisy(picture, SD, 3), picture, SD)
    for z2 in mean_square_z(found, picture):
        assert abs(z2 - 1) < 6 * np.sqrt(2 / picture.on_sphere.sum())


def test_a_variance_ten_per_cent_off_would_be_noticed() -> None:
    """The same test refuses a covariance of 0.9 times the right one."""
    picture = ball(0.15)
    found = layers_of(noisy(picture, SD, 3), picture, SD)
    for z2 in mean_square_z(found, picture, 0.9):
        assert abs(z2 - 1) > 6 * np.sqrt(2 / picture.on_sphere.sum())


def test_the_coefficients_errors_go_against_each_other_as_stated() -> None:
    """What noise adds to the body it takes from the light: the correlation is that of the covariance."""
    picture = ball(0.15)
    found = layers_of(noisy(picture, SD, 4), picture, SD)
    on = picture.on_sphere
    a = ((found.diffuse - picture.diffuse) @ found.body_colour)[on]
    s = ((found.specular - picture.specular) @ found.light_colour)[on]
    stated = found.covariance[on].mean(axis=0)
    assert np.corrcoef(a, s)[0, 1] == pytest.approx(stated[1] / np.sqrt(stated[0] * stated[2]), abs=0.02)


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
def test_the_body_colour_is_off_by_what_it_says(sigma: float) -> None:
    """Over ten photographs the body colour's error is within its stated sd, as an rms within a factor of 2."""
    picture = ball(sigma)
    true = unit(HUE)
    ratios = []
    for seed in range(10):
        found = layers_of(noisy(picture, SD, seed), picture, SD)
        ratios.append(np.radians(degrees_between(found.body_colour, true)) ** 2 / np.trace(found.body_covariance))
    assert np.sqrt(np.mean(ratios)) < 2


def test_the_body_colours_stated_error_is_neither_too_small_nor_too_large() -> None:
    """Twelve photographs of different gloss, noise and hue: z^2 averages 1 as chi-squared allows for twelve."""
    z2 = []
    for sigma in (0.1, 0.2, 0.3):
        for sd in (0.003, SD):
            for body in (HUE, HUE[::-1]):
                picture = ball(sigma, body=body)
                found = layers_of(noisy(picture, sd, len(z2)), picture, sd)
                z2.append(np.radians(degrees_between(found.body_colour, body)) ** 2 / np.trace(found.body_covariance))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 12) / 12
    assert low < np.mean(z2) < high


def test_an_uncertain_light_makes_uncertain_layers() -> None:
    """The light's covariance enters the layers': errors from a light 2 degrees off are covered where it is stated."""
    picture = ball(0.2, peak=0.95)
    side = unit(np.array([1.0, 0.0, -1.0]))
    off = unit(np.ones(3)) + np.tan(np.radians(2)) * side
    values = noisy(picture, 0.002)
    silent = layers_of(values, picture, 0.002, light_colour=off)
    honest = layers_of(
        values, picture, 0.002, light_colour=off, light_covariance=np.radians(2) ** 2 * np.outer(side, side)
    )
    strong = picture.specular[..., 0] > 0.3
    error = ((silent.specular - picture.specular) @ unit(np.ones(3)))[strong]
    assert np.sqrt(np.mean(error**2 / silent.covariance[strong][:, 2])) > 3
    assert np.sqrt(np.mean(error**2 / honest.covariance[strong][:, 2])) < 2


def test_shot_noise_told_as_gain_and_read_is_taken_at_the_local_mean() -> None:
    """A Noise gives the layers that the true variance of each sample gives, and a covariance that covers."""
    picture = ball(0.15)
    noise = Noise(gain=np.full(3, 2e-4), read=np.full(3, 0.003), source="given")
    variance = 2e-4 * picture.radiance + 0.003**2
    values = picture.radiance + np.sqrt(variance) * np.random.default_rng(5).standard_normal(variance.shape)
    told = layers_of(values, picture, 0.0, variance=noise)
    known = layers_of(values, picture, 0.0, variance=variance)
    on = picture.on_sphere
    assert normalized_root_mse(known.diffuse[on], told.diffuse[on]) < 2e-3
    assert all(abs(z2 - 1) < 0.05 for z2 in mean_square_z(told, picture))


# --- clipping and bloom -------------------------------------------------------------------------------------------


def test_clipped_pixels_are_separated_by_their_other_channels() -> None:
    """Red clipped at three quarters of its height: green and blue give both layers exactly."""
    picture = ball(0.2, peak=0.9)
    values, usable = clip(picture.radiance, 1.2)
    assert not usable[..., 0].all()
    assert usable[..., 1:].all()
    found = layers_of(values, picture, 0.0, usable=usable)
    assert psnr(found.diffuse, picture.diffuse, picture.on_sphere) > 90
    assert Flag.CLIPPED in found.flags
    assert Flag.HIGHLIGHT_CLIPPED not in found.flags


def test_a_clipped_channel_taken_at_its_word_would_spoil_the_highlight() -> None:
    """The same picture without the mask is wrong by far."""
    picture = ball(0.2, peak=0.9)
    values, _ = clip(picture.radiance, 1.2)
    assert psnr(layers_of(values, picture, 0.0).diffuse, picture.diffuse, picture.on_sphere) < 40


def test_a_core_clipped_in_all_channels_keeps_its_body_and_knows_what_it_lacks() -> None:
    """The shading around foretells the body; of the highlight at least the clipped level is kept, variance infinite."""
    picture = ball(0.1, peak=0.9)
    values, usable = clip(picture.radiance, 0.8)
    found = layers_of(values, picture, 0.0, usable=usable)
    blind = ~usable.any(axis=2)
    assert np.count_nonzero(blind) > 50
    assert psnr(found.diffuse, picture.diffuse, picture.on_sphere) > 60
    assert np.isposinf(found.covariance[blind][:, 2]).all()
    assert (found.specular[blind] <= picture.specular[blind] + 5e-3).all()
    assert Flag.HIGHLIGHT_CLIPPED in found.flags


def test_bloom_is_weighed_down() -> None:
    """Charge spilt around the clipped core pulls the body colour less where it is marked."""
    picture = ball(0.15, peak=0.9)
    values, usable = clip(noisy(picture, 0.002), 0.9)
    row, column = np.argwhere(~usable.all(axis=2)).mean(axis=0)
    near = np.hypot(*(np.indices(usable.shape[:2]) - np.array([row, column])[:, None, None])) < 60
    spilt = near & usable.all(axis=2) & picture.on_sphere
    values = values + spilt[..., None] * np.array([0.0, 0.0, -0.1])
    marked = layers_of(values, picture, 0.002, usable=usable, bloom=spilt)
    plain = layers_of(values, picture, 0.002, usable=usable)
    assert degrees_between(marked.body_colour, HUE) < 0.7 * degrees_between(plain.body_colour, HUE)


# --- what it says of itself ----------------------------------------------------------------------------------------


def test_nothing_is_flagged_on_a_good_picture() -> None:
    """One hue, one highlight, 1 % noise: a plane, no flags, the angle right within its sd."""
    picture = ball()
    found = layers_of(noisy(picture, SD), picture, SD)
    assert found.flags == ()
    assert found.cluster == "plane"
    assert abs(found.angle_deg - degrees_between(HUE, np.ones(3))) < 4 * found.angle_sd_deg + 0.05


@pytest.mark.parametrize("seed", range(3))
def test_grey_is_never_separated(seed: int) -> None:
    """A grey body under white light: no layers, infinite variance, flagged."""
    picture = ball(body=(0.6, 0.6, 0.6))
    found = layers_of(noisy(picture, SD, seed), picture, SD)
    assert Flag.COLOUR_CANNOT_SEPARATE in found.flags
    assert np.isnan(found.diffuse).all()
    assert np.isposinf(found.covariance[picture.on_sphere][:, 0]).all()
    assert found.angle_deg < 3 * found.angle_sd_deg + 0.5


@pytest.mark.parametrize(("degrees", "flagged"), [(2, True), (5, True), (12, False), (20, False)])
def test_near_grey_is_flagged_where_noise_hides_the_split(degrees: float, flagged: bool) -> None:
    """Below a few degrees the layers come with a warning; the angle itself is right."""
    picture = ball(body=turned_from_white(degrees))
    found = layers_of(noisy(picture, SD), picture, SD)
    assert (Flag.COLOUR_CANNOT_SEPARATE in found.flags) is flagged
    assert found.angle_deg == pytest.approx(degrees, abs=0.3)


def test_a_body_without_highlight_is_a_line() -> None:
    """Matte: one line, no specular layer beyond the noise, said so."""
    picture = ball(peak=0.0001)
    found = layers_of(noisy(picture, SD), picture, SD)
    assert found.cluster == "line"
    assert Flag.NO_SPECULAR in found.flags
    assert np.isnan(found.corner).all()


def test_a_metal_is_a_line() -> None:
    """Only a coloured highlight: one line as well; colour cannot tell it from a matte body."""
    picture = ball(body=(1e-6, 1e-6, 1e-6), light=(1.0, 0.8, 0.4), peak=1.0)
    found = layers_of(noisy(picture, SD), picture, SD, light_colour=np.ones(3))
    assert found.cluster == "line"
    assert Flag.NO_SPECULAR in found.flags


def test_two_hues_are_a_volume() -> None:
    """Half red, half blue: no single plane, flagged as a poor fit."""
    red, blue = ball(), ball(body=HUE[::-1])
    left = (np.arange(red.radiance.shape[1]) < red.radiance.shape[1] // 2)[None, :, None]
    found = layers_of(np.where(left, noisy(red, SD), noisy(blue, SD)), red, SD)
    assert found.cluster == "volume"
    assert Flag.POOR_FIT in found.flags


def test_a_mask_over_a_coloured_background_is_noticed() -> None:
    """A mask 15 px beside the ball takes in a blue room: a volume, a poor fit."""
    picture = ball()
    room = np.where(picture.on_sphere[..., None], noisy(picture, SD), [0.2, 0.3, 0.5])
    assert Flag.POOR_FIT in layers_of(room, picture, SD, on_sphere=np.roll(picture.on_sphere, 15, axis=1)).flags


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("body", [HUE, HUE[::-1], turned_from_white(16)])
def test_an_encoded_picture_taken_as_linear_is_noticed(sigma: float, body) -> None:
    """An sRGB curve bends the matte line; the same picture before encoding has it straight."""
    picture = ball(sigma, body=body)
    linear = 0.95 * (picture.radiance / picture.radiance.max())
    for values in (linear, linear + SD * np.random.default_rng(2).standard_normal(linear.shape)):
        sd = 0.0 if values is linear else SD
        assert Flag.MATTE_LINE_BENT in layers_of(srgb(values), picture, sd).flags
        assert Flag.MATTE_LINE_BENT not in layers_of(values, picture, sd).flags


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
def test_long_tails_do_not_bend_the_line(sigma: float) -> None:
    """GGX leaves no pixel matte but the line straight: not taken for an encoded picture."""
    picture = ball(sigma, lobe=ggx_lobe, peak=0.95)
    assert Flag.MATTE_LINE_BENT not in layers_of(noisy(picture, SD), picture, SD).flags


def test_a_veil_of_light_counts_as_specular() -> None:
    """A mirrored room lies over the shadow too; seen there, it is kept out of the body colour."""
    with_room, without = ball(0.1, veil=0.4), ball(0.1)
    found = layers_of(noisy(with_room, 0.002), with_room, 0.002)
    blind = layers_of(noisy(without, 0.002) + 0.4 * 0.04, without, 0.002)  # the same room, the limb's rise left out
    assert degrees_between(found.body_colour, HUE) < 2.5
    assert degrees_between(blind.body_colour, HUE) < 0.5


def test_the_corner_of_the_t_is_where_the_highlight_lies() -> None:
    """The highlight leaves the matte line at the brightness of the body under it, along the light's colour."""
    picture = ball(0.05)
    found = layers_of(noisy(picture, 0.002), picture, 0.002)
    under = picture.diffuse[np.unravel_index(np.argmax(picture.specular[..., 0]), picture.specular.shape[:2])]
    assert np.allclose(found.corner, under, rtol=0.05)
    assert degrees_between(found.highlight_colour, np.ones(3)) < 4


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((40, 40, 3)), "no light"),
        (np.full((40, 40, 3), np.nan), "0 pixels"),
        (np.ones((40, 40)), "colour image"),
        (np.ones((40, 40, 1)), "colour image"),
        (np.ones((40, 40, 4)), "colour image"),
        (np.ones((5, 5, 3)), "25 pixels"),
        (-np.ones((40, 40, 3)), "no light"),
    ],
)
def test_hopeless_pictures_are_refused_in_one_line(values: np.ndarray, message: str) -> None:
    """Black, empty, monochrome or tiny: a line that says what was found and expected."""
    with pytest.raises(BadInputError, match=message) as told:
        separate(values, variance=np.full(3, 1e-4), light_colour=np.ones(3))
    assert "\n" not in str(told.value)


def test_all_clipped_is_refused() -> None:
    """No pixel with every channel: no cluster to see."""
    values = np.ones((40, 40, 3))
    with pytest.raises(BadInputError, match="expose less"):
        separate(values, variance=np.full(3, 1e-4), usable=values < 1, light_colour=np.ones(3))


def test_one_colour_replicated_from_one_channel_is_flagged() -> None:
    """A monochrome picture in three equal channels separates into nothing."""
    picture = ball()
    grey = np.repeat(noisy(picture, SD).mean(axis=2, keepdims=True), 3, axis=2)
    assert Flag.COLOUR_CANNOT_SEPARATE in layers_of(grey, picture, SD).flags


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"light_colour": np.array([1.0, -0.1, 1.0])}, "light colour"),
        ({"light_colour": np.zeros(3)}, "light colour"),
        ({"light_colour": np.array([1.0, np.nan, 1.0])}, "light colour"),
        ({"variance": np.full((2, 3), 1e-4)}, "variance has shape"),
        ({"variance": np.array([1e-4, -1.0, 1e-4])}, "negative"),
        ({"usable": np.ones((3, 3), bool)}, "usable has shape"),
        ({"bloom": np.ones((3, 3), bool)}, "bloom has shape"),
        ({"on_sphere": np.ones((3, 3), bool)}, "on_sphere has shape"),
    ],
)
def test_mistakes_are_named(options: dict, message: str) -> None:
    """Each wrong argument is told by name."""
    picture = ball()
    with pytest.raises(BadInputError, match=message):
        layers_of(picture.radiance, picture, SD, **options)


def test_nothing_that_comes_in_is_changed() -> None:
    """The caller's arrays keep their values, and the record's are read-only."""
    picture = ball()
    values = noisy(picture, SD)
    kept = values.copy()
    found = layers_of(values, picture, SD)
    assert np.array_equal(values, kept)
    with pytest.raises(ValueError, match="read-only"):
        found.diffuse[0, 0, 0] = 1


def garbage(rng: np.random.Generator, kind: int) -> np.ndarray:
    """Pictures that nobody should send: noise, constants, a single bright pixel, 60 decades of range, gaps."""
    h, w = rng.integers(4, 60, 2)
    flat, colour = rng.random((h, w, 1)), rng.random(3)
    return [
        lambda: rng.standard_normal((h, w, 3)),
        lambda: np.full((h, w, 3), rng.random()),
        lambda: flat * colour,
        lambda: np.where(np.arange(h * w).reshape(h, w, 1) == h, 1.0, 0.0) * np.ones(3),
        lambda: 10.0 ** rng.uniform(-30, 30, (h, w, 3)),
        lambda: np.where(rng.random((h, w, 3)) < 0.3, np.nan, flat * colour),
        lambda: (flat * colour).astype(np.float32) * np.float32(1e-20),
        lambda: np.round(flat * colour * 7) / 7,
    ][kind]()


@pytest.mark.parametrize("kind", range(8))
def test_garbage_ends_in_an_answer_or_a_clear_refusal(kind: int) -> None:
    """Never a crash, never a warning: finite angles and unit colours, or one line."""
    rng = np.random.default_rng(kind)
    for _ in range(12):
        values = garbage(rng, kind)
        variance = [np.zeros(3), np.full(3, 1e-4), np.full(3, 1e30)][rng.integers(3)]
        usable = [None, rng.random(values.shape) < 0.95][rng.integers(2)]
        light = [None, np.ones(3), np.array([1.0, 0.0, 0.0])][rng.integers(3)]
        try:
            found = separate(values, variance=variance, usable=usable, light_colour=light)
        except BadInputError:
            continue
        assert np.isfinite([found.angle_deg, found.angle_sd_deg]).all()
        assert np.linalg.norm(found.body_colour) == pytest.approx(1)


def test_the_same_ball_under_many_lights_has_one_body_colour() -> None:
    """Six real photographs agree on 13 to 14.5 degrees; encoded they are noticed, as taken they are not bent."""
    import cv2

    data = realdata.folder("diligent_ball")
    mask = cv2.imread(str(data / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    power = np.loadtxt(data / "light_intensities.txt")
    names = (data / "filenames.txt").read_text().split()
    rows, columns = np.nonzero(mask)
    box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    for k in (0, 6, 12, 18, 24, 36):
        raw = cv2.imread(str(data / names[k]), cv2.IMREAD_UNCHANGED)[..., ::-1][box] / 65535
        usable = raw < 0.98
        values = raw / power[k] * power[k].min()
        options = {"variance": np.full(3, 1e-6), "usable": usable, "on_sphere": mask[box], "light_colour": np.ones(3)}
        found = separate(values, **options)
        assert 13 < found.angle_deg < 14.5
        assert Flag.MATTE_LINE_BENT not in found.flags
        assert Flag.MATTE_LINE_BENT in separate(srgb(values), **options).flags
