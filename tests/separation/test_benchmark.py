"""The benchmark that anyone can run."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks import layer_score as judge
from tests.benchmarks import separation as bench
from tests.benchmarks.separation_targets import light_errors, targets, withheld
from tests.benchmarks.spheres import cases, gaussian_lobe, glossy


def test_the_bound_is_that_of_least_squares() -> None:
    """The limit is the mean square error of a projection on both true colours, over many draws."""
    picture = glossy("one hue", gaussian_lobe(0.2))
    on = picture.on_sphere
    colours = np.stack([picture.diffuse[on].sum(axis=0), picture.light_colour], axis=1)
    noise = 0.01 * np.random.default_rng(0).standard_normal((on.sum(), 3))
    error = (noise @ np.linalg.pinv(colours).T)[:, :1] * colours[:, 0]
    psnr = 10 * np.log10(picture.diffuse[on].max() ** 2 / np.mean(error**2))
    assert judge.limit(picture, 0.01)[0] == pytest.approx(psnr, abs=0.05)


def test_perfect_layers_score_perfectly_and_none_scores_nothing() -> None:
    """The truth has no error; doing nothing has a relative rms of 1; layers that are NaN have no score."""
    picture = cases(0.2)[0]
    assert judge.score(picture, (picture.diffuse, picture.specular)) == (np.inf, 0.0)
    nothing = bench.do_nothing(picture.radiance, picture, 0.01, np.ones(picture.radiance.shape, bool))
    assert judge.score(picture, nothing)[1] == pytest.approx(1)
    unknown = np.full(picture.radiance.shape, np.nan)
    assert np.isnan(judge.score(picture, (unknown, unknown))).all()


def test_a_missed_target_is_told_as_missed() -> None:
    """Rows that are too bad are not met; the same rows with a good answer are."""
    good, bad = {"psnr_db": 100.0, "relative_rms": 1e-4}, {"psnr_db": 10.0, "relative_rms": 1.0}
    rows = []
    for case in ("one hue", "grey", "3.8 % clipped", "12-bit", "GGX tails"):
        for noise in (0.0, judge.NOISE):
            methods = {"colour only": bad if case == "one hue" else good, "pooled": good, "known shape": good}
            methods["known shape"] = bad if case == "grey" else good
            limit = {"psnr_db": 100.2, "relative_rms": 0.0}
            rows.append({"case": case, "noise": noise, "limit": limit, "methods": methods})
    hidden = [{"psnr_db": 30.0, "colour_psnr_db": 30.0, "flags": []}]
    lights = {"colour": 1.0, "shape": 1.0}
    asked = targets(rows, lights, {"colour only": 0.01, "known shape": 3.0}, hidden)
    missed = [each["what"].split(",")[0] for each in asked if not each["met"]]
    assert missed == [
        "colour only",
        "colour only",
        "the same by known shape",
        "known shape",
        "known shape",
        "lobe withheld: share of answers flagged",
        "known shape",
    ]
    assert len(asked) > 2 * len(missed)


@pytest.mark.slow
def test_every_figure_but_time_is_reached() -> None:
    """The whole benchmark, without the rival: all targets of accuracy are met."""
    methods = {"colour only": bench.colour_only, "pooled": bench.pooled, "known shape": bench.known_shape}
    rows = bench.run(methods, quick=False)
    asked = targets(rows, light_errors(), {"colour only": 0.0, "known shape": 0.0}, withheld())
    assert all(each["met"] for each in asked), [each for each in asked if not each["met"]]
