"""The coefficients of two colours in a pixel, beside plain weighted least squares in float64."""

from __future__ import annotations

import numpy as np
import pytest

from tests.separation.balls import unit
from toolkit.records import Floats
from toolkit.separation.coefficients import Solver, across, apart

BODY, LIGHT = unit(np.array([0.9, 0.4, 0.15])), unit(np.array([1.0, 0.9, 0.8]))


def plain(values: Floats, usable: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Coefficients (2,) and covariance (2, 2) of one pixel, by the normal equations of its usable channels."""
    pair, weight = np.stack([BODY, LIGHT], axis=1)[usable], 1 / variance[usable]
    covariance = np.linalg.inv(pair.T @ (weight[:, None] * pair))
    return covariance @ (pair.T @ (weight * values[usable])), covariance


@pytest.mark.parametrize(("loud", "kind"), [(1.0, np.float32), (1e9, np.float32), (1e9, np.float64)])
def test_pixels_of_all_and_of_some_channels_are_weighted_by_their_noise(loud: float, kind: type) -> None:
    """Each channel by its own variance, also where one of three tells next to nothing; NaN below two channels."""
    rng = np.random.default_rng(0)
    n = 200
    values, usable = rng.random((3, n)).astype(kind), rng.random((3, n)) < 0.7
    usable[:, :50] = True
    variance = (10 ** rng.uniform(-7, -5, (3, n))).astype(kind)
    variance[rng.integers(3, size=50), np.arange(50)] *= loud
    found = Solver.of(BODY, LIGHT, kind).solve(values, usable, variance)
    near, close = (1e-4, 5e-6) if kind is np.float32 else (1e-9, 1e-11)
    for i in range(n):
        if usable[:, i].sum() < 2:
            assert np.isnan(found.both[:, i]).all()
            assert np.isnan(found.covariance[:, i]).all()
            continue
        both, covariance = plain(values[:, i].astype(float), usable[:, i], variance[:, i].astype(float))
        told = found.covariance[:, i]
        assert found.both[:, i] == pytest.approx(both, abs=5 * close)
        assert told[[0, 2]] == pytest.approx(np.diag(covariance), rel=near)
        assert told[1] == pytest.approx(covariance[0, 1], abs=near * float(np.sqrt(told[0] * told[2])))
        off = across(BODY, LIGHT) @ values[:, i] if usable[:, i].all() else np.nan
        assert found.off[i] == pytest.approx(off, abs=close, nan_ok=True)


def test_one_variance_for_all_pixels_is_that_of_each() -> None:
    """A channel's variance (3, 1) counts as if it were written for every pixel."""
    rng = np.random.default_rng(1)
    values, usable, variance = rng.random((3, 20)), np.ones((3, 20), bool), np.array([[1e-6], [4e-6], [2e-6]])
    solver = Solver.of(BODY, LIGHT, float)
    one, each = (solver.solve(values, usable, v) for v in (variance, np.repeat(variance, 20, axis=1)))
    for first, second in zip(one, each, strict=True):
        np.testing.assert_allclose(first, second, rtol=1e-12)


def test_one_colour_is_not_two() -> None:
    """Two colours are apart unless rounding alone parts them."""
    assert apart(BODY, LIGHT)
    assert not apart(LIGHT, unit(LIGHT + 1e-9))
