"""Separation by polarised light."""

from __future__ import annotations

import numpy as np
import pytest

from tests.separation.balls import ball
from toolkit.errors import BadInputError
from toolkit.separation.polarised import PolarisedLayers, separate_polarised

ANGLES = (0.0, 45.0, 90.0, 135.0)
PARALLEL = 25.0
SD = 0.01


def behind_analyser(picture, angles, sd: float = 0.0, seed: int = 0) -> np.ndarray:
    """The ball under a polarised lamp, as each angle of the analyser shows it."""
    turned = np.radians(np.asarray(angles) - PARALLEL)[:, None, None, None]
    clean = picture.diffuse / 2 + picture.specular * np.cos(turned) ** 2
    return clean + sd * np.random.default_rng(seed).standard_normal(clean.shape)


def layers(picture, angles=ANGLES, sd: float = 0.0, seed: int = 0, **options) -> PolarisedLayers:
    return separate_polarised(behind_analyser(picture, angles, sd, seed), angles, variance=np.full(3, sd**2), **options)


@pytest.mark.parametrize("angles", [(0, 60, 120), ANGLES, (3, 20, 77, 101, 160)])
def test_clean_pictures_are_separated_exactly(angles) -> None:
    """Three or more angles give both layers and the lamp's angle to rounding, for a grey body as well."""
    picture = ball(body=(0.6, 0.6, 0.6))
    found = layers(picture, angles)
    assert np.abs(found.diffuse - picture.diffuse).max() < 1e-9
    assert np.abs(found.specular - picture.specular).max() < 1e-9
    assert found.parallel_deg == pytest.approx(PARALLEL, abs=1e-6)


def test_two_pictures_are_enough_where_the_lamps_angle_is_known() -> None:
    """Parallel and crossed: the classic pair."""
    picture = ball()
    found = layers(picture, (PARALLEL, PARALLEL + 90), parallel_deg=PARALLEL)
    assert np.abs(found.diffuse - picture.diffuse).max() < 1e-9
    assert np.isnan(found.chi2_reduced)


def test_the_stated_covariance_is_the_error() -> None:
    """Mean z^2 over all samples is 1 within 2 %, and chi^2 over its degrees of freedom as well."""
    picture = ball()
    found = layers(picture, sd=SD)
    for layer, truth, entry in ((found.diffuse, picture.diffuse, 0), (found.specular, picture.specular, 2)):
        assert np.mean((layer - truth) ** 2 / found.covariance[..., entry]) == pytest.approx(1, abs=0.02)
    assert found.chi2_reduced == pytest.approx(1, abs=0.02)


def test_the_length_of_the_stokes_vector_would_be_biased() -> None:
    """Where there is no highlight the projection averages to 0; sqrt(s1^2 + s2^2) does not."""
    picture = ball()
    dark = picture.specular < 1e-6
    found = layers(picture, sd=SD)
    assert abs(np.mean(found.specular[dark])) < 5 * SD / np.sqrt(dark.sum())
    shown = behind_analyser(picture, ANGLES, SD)
    length = np.hypot(shown[0] - shown[2], shown[1] - shown[3])
    assert np.mean(length[dark]) > SD


def test_the_lamps_angle_is_off_by_what_it_says() -> None:
    """Over 20 sets of pictures its z^2 averages 1 within a factor of 2.5."""
    z2 = []
    for seed in range(20):
        found = layers(ball(), sd=0.05, seed=seed)
        z2.append(((found.parallel_deg - PARALLEL) / found.parallel_sd_deg) ** 2)
    assert 0.4 < np.mean(z2) < 2.5


def test_each_samples_own_variance_is_carried() -> None:
    """Shot noise told sample by sample gives covering variances."""
    picture = ball()
    clean = behind_analyser(picture, ANGLES)
    variance = 1e-5 + 2e-4 * clean
    shown = clean + np.sqrt(variance) * np.random.default_rng(1).standard_normal(clean.shape)
    found = separate_polarised(shown, ANGLES, variance=variance)
    assert np.mean((found.specular - picture.specular) ** 2 / found.covariance[..., 2]) == pytest.approx(1, abs=0.03)


def test_unusable_samples_have_no_layers() -> None:
    """Clipped at one angle: NaN there, nothing else touched."""
    picture = ball()
    shown = behind_analyser(picture, ANGLES)
    found = separate_polarised(shown, ANGLES, variance=np.full(3, 1e-6), usable=shown < 0.6)
    clipped = ~(shown < 0.6).all(axis=0)
    assert np.isnan(found.specular[clipped]).all()
    assert np.abs(found.specular - picture.specular)[~clipped].max() < 1e-9


@pytest.mark.parametrize(
    ("shape", "angles", "message"),
    [
        ((3, 8, 8), (0, 60, 120), "expected"),
        ((3, 8, 8, 3), (0, 60), "expected"),
        ((2, 8, 8, 3), (0, 90), "do not tell"),
        ((3, 8, 8, 3), (10, 10, 190), "do not tell"),
    ],
)
def test_what_cannot_be_separated_is_refused(shape, angles, message: str) -> None:
    """Wrong shapes, too few angles, the same angle again."""
    with pytest.raises(BadInputError, match=message):
        separate_polarised(np.ones(shape), angles, variance=np.full(3, 1e-4))


def test_unpolarised_pictures_are_refused() -> None:
    """A forgotten filter: nothing turns with the analyser, so the lamp's angle is not seen."""
    picture = ball()
    same = np.repeat(picture.radiance[None] / 2, 4, axis=0)
    same = same + SD * np.random.default_rng(0).standard_normal(same.shape)
    with pytest.raises(BadInputError, match="no polarised highlight"):
        separate_polarised(same, ANGLES, variance=np.full(3, SD**2))
