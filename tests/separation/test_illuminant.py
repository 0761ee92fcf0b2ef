"""The light's colour, from every source, with the error that each states."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tests.benchmarks.spheres import WARM
from tests.separation.balls import HUE, ball, clip, degrees_between, ggx_lobe, layers_of, noisy, unit
from toolkit.errors import BadInputError
from toolkit.flags import Flag
from toolkit.separation import best_illuminant, common_line, grey_card, illuminant
from toolkit.separation.highlight_colour import by_highlight_line
from toolkit.separation.inverse_intensity import by_inverse_intensity
from toolkit.separation.samples import samples

SD = 0.01


def ready(picture, sd: float, seed: int = 0):
    return samples(noisy(picture, sd, seed), variance=np.full(3, sd**2), on_sphere=picture.on_sphere)


@pytest.mark.parametrize("sigma", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("lobe", [None, ggx_lobe])
@pytest.mark.parametrize("body", [HUE, (0.2, 0.35, 0.6)])
def test_the_highlight_line_finds_warm_light_within_its_error(sigma: float, lobe, body) -> None:
    """One hue, 1 % noise: at most 2 degrees off, and within three stated sds."""
    picture = ball(sigma, body=body, light=WARM, peak=0.95, **({"lobe": lobe} if lobe else {}))
    found = by_highlight_line(ready(picture, SD))
    assert found is not None
    off = degrees_between(found.colour, WARM)
    assert off < 2
    assert off < 3 * found.sd_deg


def test_the_bare_highlight_line_leans_as_the_shading_beneath_it_makes_it() -> None:
    """The cluster's own direction is off by what the true layers say it must be, seven degrees, and not by less.

    Along the highlight the body brightens by `slope` for each unit of light, in least squares weighted by the light:
    the line points along light + slope body. What `by_highlight_line` does away with is this.
    """
    picture = ball(0.3, light=WARM, peak=0.3)
    found = layers_of(noisy(picture, 0.002), picture, 0.002)
    a, s = picture.diffuse @ unit(picture.diffuse.sum(axis=(0, 1))), picture.specular @ unit(WARM)
    out = picture.on_sphere & (s > 0.1 * s.max())
    slope = np.polyfit(s[out], a[out], 1, w=np.sqrt(s[out]))[0]
    leaning = unit(WARM) + slope * unit(picture.diffuse.sum(axis=(0, 1)))
    assert degrees_between(leaning, WARM) > 7
    assert degrees_between(found.highlight_colour, leaning) < 0.3


@pytest.mark.parametrize("sigma", [0.1, 0.2])
def test_inverse_intensity_is_within_its_stated_error(sigma: float) -> None:
    """Within three stated sds, and nearer than a guess."""
    picture = ball(sigma, light=WARM, peak=0.95)
    found = by_inverse_intensity(ready(picture, SD))
    assert found is not None
    off = degrees_between(found.colour, WARM)
    assert off < min(3 * found.sd_deg, 8)


def test_inverse_intensity_is_exact_where_its_assumption_holds() -> None:
    """Highlights over a body of even brightness meet in the light's chromaticity: the mean of six within 0.01 degrees.

    Their errors are covered: z^2 over six pictures of two coordinates each is at most what chi-squared allows.
    """
    off, z2 = [], []
    for seed in range(6):
        found = by_inverse_intensity(even_bodies(seed))
        assert found is not None
        off.append(degrees_between(found.colour, WARM))
        z2.append(np.sum((found.colour - unit(WARM)) ** 2) / (np.trace(found.covariance) / 2))
    assert np.mean(off) < 0.01
    assert np.sum(z2) < chi2.ppf(0.999, 12)


def even_bodies(seed: int):
    """Patches of highlight of different strength over a body of even brightness, little noise."""
    rng = np.random.default_rng(seed)
    body, light = np.array(HUE), np.array(WARM)
    strength = np.where(rng.random((96, 96)) < 0.5, rng.uniform(0.1, 1, (96, 96)), 0)
    strength = np.repeat(np.repeat(strength[::8, ::8], 8, 0), 8, 1)
    values = 0.6 * body * light + strength[..., None] * light + 1e-3 * rng.standard_normal((96, 96, 3))
    return samples(values, variance=np.full(3, 1e-6))


@pytest.mark.parametrize("way", [by_highlight_line, by_inverse_intensity])
def test_no_highlight_gives_no_light(way) -> None:
    """A matte ball says nothing of the light's colour."""
    assert way(ready(ball(peak=1e-4), SD)) is None


def test_clipped_highlights_still_tell() -> None:
    """With the core clipped in red, the flanks are enough."""
    picture = ball(0.2, light=WARM, peak=0.95)
    values, usable = clip(noisy(picture, SD), 1.1)
    found = best_illuminant(values, variance=np.full(3, SD**2), usable=usable, on_sphere=picture.on_sphere)
    assert degrees_between(found.colour, WARM) < 3


# --- ranking ---------------------------------------------------------------------------------------------------


def test_the_more_reliable_source_wins_and_says_why() -> None:
    """Given beats card beats the highlight; the reason names the choice, its error and the others."""
    picture = ball(0.2, light=WARM, peak=0.95)
    told = {"variance": np.full(3, SD**2), "on_sphere": picture.on_sphere}
    values = noisy(picture, SD)
    given = illuminant(np.array(WARM), sd_deg=0.1, source="given")
    card = illuminant(np.ones(3), sd_deg=0.01, source="card")
    assert best_illuminant(values, known=[card, given], **told).source == "given"
    assert best_illuminant(values, known=[card], **told).source == "card"
    alone = best_illuminant(values, **told)
    assert alone.source == "highlight-line"
    assert "highlight line" in alone.reason
    assert "assumed 15" in alone.reason


def test_without_a_highlight_the_camera_is_believed_then_nobody() -> None:
    """A matte ball: the camera's white balance, else neutral, each with its wide error."""
    picture = ball(peak=1e-4)
    told = {"variance": np.full(3, SD**2), "on_sphere": picture.on_sphere}
    values = noisy(picture, SD)
    assert best_illuminant(values, camera_white=np.array([0.5, 1, 0.7]), **told).source == "camera"
    last = best_illuminant(values, **told)
    assert last.source == "assumed"
    assert last.sd_deg == pytest.approx(15)


def test_a_source_insisted_on_is_used_or_refused() -> None:
    """--illuminant inverse-intensity uses it; where it finds nothing, that is said."""
    picture = ball(0.2, peak=0.95)
    told = {"variance": np.full(3, SD**2), "on_sphere": picture.on_sphere}
    chosen = best_illuminant(noisy(picture, SD), source="inverse-intensity", **told)
    assert chosen.source == "inverse-intensity"
    with pytest.raises(BadInputError, match="cannot be had"):
        best_illuminant(noisy(ball(peak=1e-4), SD), source="highlight-line", **told)


def test_separate_without_a_light_finds_its_own() -> None:
    """No light given: the highlight's, its error in the angle's and in the layers' covariance."""
    picture = ball(0.2, light=WARM, peak=0.95)
    found = layers_of(noisy(picture, SD), picture, SD, light_colour=None)
    assert found.light_source == "highlight-line"
    assert degrees_between(found.light_colour, WARM) < 1
    assert np.trace(found.light_covariance) > 0
    assert Flag.COLOUR_CANNOT_SEPARATE not in found.flags


def test_an_illuminants_error_is_alike_in_all_directions() -> None:
    """Sd in degrees is the rms angle; along the colour itself there is none."""
    found = illuminant(np.array([2.0, 1.0, 1.0]), sd_deg=3, source="given")
    assert found.sd_deg == pytest.approx(3)
    assert found.colour @ found.covariance @ found.colour == pytest.approx(0, abs=1e-12)


# --- grey card ---------------------------------------------------------------------------------------------------


def card_picture(seed: int = 0) -> np.ndarray:
    """A card of even hue, shaded from one side to the other, in a dark room."""
    rng = np.random.default_rng(seed)
    values = np.zeros((60, 80, 3))
    values[10:50, 20:60] = np.array(WARM) * np.linspace(0.2, 0.6, 40)[None, :, None]
    return values + 0.005 * rng.standard_normal(values.shape)


BOX = (20, 10, 60, 50)


def test_a_grey_card_gives_its_hue_and_error() -> None:
    """Shading divides out; the error is the card's own half degree."""
    found = grey_card(card_picture(), BOX, variance=np.full(3, 0.005**2))
    assert degrees_between(found.colour, WARM) < 0.1
    assert found.sd_deg == pytest.approx(0.5, abs=0.05)


def test_the_cards_noise_covers_its_error() -> None:
    """A perfect card in noise: mean square error over 40 pictures is the stated one within a factor of 1.6."""
    ratios = []
    for seed in range(40):
        found = grey_card(card_picture(seed), BOX, variance=np.full(3, 0.005**2), card_sd_deg=0.0)
        ratios.append(np.sum((found.colour - unit(WARM)) ** 2) / np.trace(found.covariance))
    assert 1 / 1.6 < np.mean(ratios) < 1.6


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ((20, 10, 90, 50), "outside"),
        ((0, 0, 12, 9), "dark|light"),
        ((20, 10, 21, 12), "pixels"),
        ((60, 50, 20, 10), "outside"),
    ],
)
def test_a_card_that_is_none_is_refused(box, message: str) -> None:
    """Outside the picture, in the dark, too small or turned about."""
    with pytest.raises(BadInputError, match=message):
        grey_card(card_picture(), box, variance=np.full(3, 0.005**2))


def test_a_card_of_two_hues_is_refused() -> None:
    """A rectangle over the card's edge on to something red is not one even patch."""
    values = card_picture()
    values[10:50, 40:60] *= [1.0, 0.5, 0.5]
    with pytest.raises(BadInputError, match="varies in hue"):
        grey_card(values, BOX, variance=np.full(3, 0.005**2))


def test_a_clipped_card_is_refused() -> None:
    """More than half of it clipped."""
    values = card_picture()
    with pytest.raises(BadInputError, match="clipped"):
        grey_card(values, BOX, variance=np.full(3, 0.005**2), usable=values < 0.3)


# --- planes ------------------------------------------------------------------------------------------------------


def two_balls(first, second, sd: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Two balls side by side under one warm light, and whose pixels are whose."""
    left, right = ball(0.15, body=first, light=WARM), ball(0.15, body=second, light=WARM)
    values = np.concatenate([noisy(left, sd, seed), noisy(right, sd, seed + 1)], axis=1)
    labels = np.concatenate([np.where(left.on_sphere, 0, -1), np.where(right.on_sphere, 1, -1)], axis=1)
    return values, labels


def test_two_bodies_planes_meet_in_the_light() -> None:
    """Red and blue balls give the light to a tenth of a degree without noise."""
    values, labels = two_balls(HUE, HUE[::-1], 0.0)
    found = common_line(values, labels, variance=np.zeros(3))
    assert degrees_between(found.colour, WARM) < 0.1


def test_the_planes_error_is_the_stated_one() -> None:
    """Over 20 pictures at 1 % noise the mean square error is the stated one within a factor of 2."""
    ratios = []
    for seed in range(20):
        values, labels = two_balls(HUE, HUE[::-1], SD, 2 * seed)
        found = common_line(values, labels, variance=np.full(3, SD**2))
        ratios.append(np.sum((found.colour - unit(WARM)) ** 2) / np.trace(found.covariance))
    assert 0.5 < np.mean(ratios) < 2


def test_bodies_of_one_hue_do_not_tell() -> None:
    """Two balls of the same colour have the same plane: refused."""
    values, labels = two_balls(HUE, tuple(0.5 * np.array(HUE)), SD)
    with pytest.raises(BadInputError, match="hue"):
        common_line(values, labels, variance=np.full(3, SD**2))


def test_a_single_body_does_not_tell() -> None:
    """One plane contains the light but does not place it: refused."""
    values, labels = two_balls(HUE, HUE[::-1], SD)
    with pytest.raises(BadInputError, match="two of them"):
        common_line(values, np.where(labels == 1, -1, labels), variance=np.full(3, SD**2))


def test_bodies_of_nearly_one_hue_state_a_larger_error() -> None:
    """The nearer the hues, the worse the planes meet, and it says so."""
    far = common_line(*two_balls(HUE, HUE[::-1], SD), variance=np.full(3, SD**2))
    near = common_line(*two_balls(HUE, (0.742, 0.36, 0.1), SD), variance=np.full(3, SD**2))
    assert near.sd_deg > 3 * far.sd_deg
    assert degrees_between(near.colour, WARM) < 3 * near.sd_deg
