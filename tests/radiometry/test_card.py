"""A card of known reflectance: its mean, its error, exposures, and every card that is none."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.errors import BadInputError
from toolkit.radiometry.card import SETTINGS_SD, exposure_ratio, measure_card
from toolkit.radiometry.quads import Quads
from toolkit.records import Metadata, Noise

NOISE = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1e-3), source="given")
BOX = (30, 20, 40, 50)
RADIANCE = np.array([0.2, 0.3, 0.1])


def picture(slope: float = 0.0, level: float = 1.0, seed: int = 0, clipped: int = 0) -> Quads:
    """A card 40 x 50 px in the dark; `slope` is its relative change from left to right."""
    rng = np.random.default_rng(seed)
    values = np.zeros((100, 100, 3))
    x, y, width, height = BOX
    values[y : y + height, x : x + width] = (
        level * RADIANCE * (1 + slope * ((np.arange(width) + 0.5) / width - 0.5))[None, :, None]
    )
    noisy = values + np.sqrt(1e-4 * values + 1e-6) * rng.standard_normal(values.shape)
    flags = np.zeros((100, 100), np.uint8)
    flags[y, x : x + clipped] = 1
    return Quads(values=noisy.astype(np.float32), flags=flags, origin_px=(0.0, 0.0), step_px=1)


def test_the_mean_and_its_error_are_right() -> None:
    """Over 100 cards the deviations in stated errors have a mean square near one (chi-square, 300 values, 1 %)."""
    found = [measure_card(picture(seed=seed), BOX, NOISE) for seed in range(100)]
    z = np.array([(card.radiance / RADIANCE - 1) / card.relative_sd for card in found])
    assert 0.3 < np.mean(z**2) < 1.22  # what 16 blocks scatter by chance widens the error, never narrows it


def test_a_slope_across_the_card_widens_its_error() -> None:
    """The mean stands; the error is the sd of the card's own parts."""
    card = measure_card(picture(slope=0.2), BOX, NOISE)
    np.testing.assert_allclose(card.radiance, RADIANCE, rtol=2e-3)
    np.testing.assert_allclose(card.relative_sd, 0.2 * np.sqrt(5) / 8, rtol=0.1)  # of -3/8, -1/8, 1/8, 3/8 of the slope


@pytest.mark.parametrize(
    ("made", "box", "line"),
    [
        ({"clipped": 40}, BOX, r"2% of the reference card is clipped; expected none"),
        ({"level": 0.0}, BOX, "dark"),
        ({"slope": 0.8}, BOX, "varies by"),
        ({}, (10, 20, 60, 50), "varies by"),
        ({}, (30, 20, 5, 50), "5 x 50 px; expected 8"),
    ],
)
def test_a_card_that_cannot_be_used_is_refused_in_a_line(made: dict[str, float], box: object, line: str) -> None:
    """Clipped, dark, uneven, over its edge, too small."""
    with pytest.raises(BadInputError, match=line) as caught:
        measure_card(picture(**made), box, NOISE)  # type: ignore[arg-type]  # parametrised
    assert "\n" not in str(caught.value)


def test_exposures_are_compared_by_time_iso_and_stop() -> None:
    """Twice the time, half the ISO, one stop more; nothing told: the same; one told, or two cameras: refused."""
    ball = Metadata(make="A", model="B", exposure_s=1 / 30, iso=100.0, f_number=8.0)
    card = Metadata(make="A", model="B", exposure_s=1 / 60, iso=200.0, f_number=8.0 * np.sqrt(2))
    assert exposure_ratio(ball, card) == (pytest.approx(2.0), SETTINGS_SD)
    assert exposure_ratio(ball, ball) == (1.0, 0.0)
    assert exposure_ratio(Metadata(), Metadata()) == (1.0, 0.0)
    with pytest.raises(BadInputError, match="only the ball tells its iso"):
        exposure_ratio(ball, Metadata(make="A", model="B", exposure_s=1.0, f_number=8.0))
    with pytest.raises(BadInputError, match="expected one camera"):
        exposure_ratio(ball, Metadata(make="A", model="C"))
