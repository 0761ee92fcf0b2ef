"""The benchmark that anyone can run."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks import separation as bench
from tests.benchmarks.spheres import cases, gaussian_lobe, glossy


def test_the_bound_is_that_of_least_squares() -> None:
    """The limit is the mean square error of a projection on both true colours, over many draws."""
    picture = glossy("one hue", gaussian_lobe(0.2))
    on = picture.on_sphere
    colours = np.stack([picture.diffuse[on].sum(axis=0), picture.light_colour], axis=1)
    noise = 0.01 * np.random.default_rng(0).standard_normal((on.sum(), 3))
    error = (noise @ np.linalg.pinv(colours).T)[:, :1] * colours[:, 0]
    psnr = 10 * np.log10(picture.diffuse[on].max() ** 2 / np.mean(error**2))
    assert bench.limit(picture, 0.01)[0] == pytest.approx(psnr, abs=0.05)


def test_perfect_layers_score_perfectly_and_none_scores_nothing() -> None:
    """The truth has no error; doing nothing has a relative rms of 1; layers that are NaN have no score."""
    picture = cases(0.2)[0]
    assert bench.score(picture, (picture.diffuse, picture.specular)) == (np.inf, 0.0)
    nothing = bench.do_nothing(picture.radiance, picture, 0.01, np.ones(picture.radiance.shape, bool))
    assert bench.score(picture, nothing)[1] == pytest.approx(1)
    unknown = np.full(picture.radiance.shape, np.nan)
    assert np.isnan(bench.score(picture, (unknown, unknown))).all()


def test_a_missed_target_is_told_as_missed() -> None:
    """Rows that are too bad are not met; the same rows with a good answer are."""
    rows = []
    for case in ("one hue", "3.8 % clipped", "12-bit"):
        for noise in (0.0, bench.NOISE):
            good, bad = {"psnr_db": 100.0, "relative_rms": 0.0}, {"psnr_db": 10.0, "relative_rms": 1.0}
            methods = {"colour only": bad if case == "one hue" else good, "pooled": good}
            limit = {"psnr_db": 100.2, "relative_rms": 0.0}
            rows.append({"case": case, "noise": noise, "limit": limit, "methods": methods})
    asked = bench.targets(rows, {"error_deg": 1.0}, 0.01)
    assert [each["met"] for each in asked] == [False, False, True, True, True, True, True]


@pytest.mark.slow
def test_every_figure_but_time_is_reached() -> None:
    """The whole benchmark, without the rival: all targets of accuracy are met."""
    rows = bench.run({"colour only": bench.colour_only, "pooled": bench.pooled}, quick=False)
    asked = bench.targets(rows, bench.illuminant_error(), 0.0)
    assert all(each["met"] for each in asked), [each for each in asked if not each["met"]]
