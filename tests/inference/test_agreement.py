"""Layers by colour beside layers by known shape: which to believe, and the light's colour that shape shows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.benchmarks.known_shape import WITHOUT_TAIL, Answer, by_shape
from tests.benchmarks.layer_score import photograph, score
from tests.benchmarks.separation_targets import off_deg
from tests.benchmarks.spheres import HUE, WARM, WHITE, Picture, gaussian_lobe, ggx_lobe, glossy, turned_from_white
from toolkit.flags import Flag
from toolkit.inference.light_colour import light_colour

SD = 0.01
GREY = (0.742, 0.742, 0.742)


@cache
def answer(lobe: str, body: tuple[float, ...] = HUE, light: tuple[float, ...] = WHITE) -> tuple[Picture, Answer]:
    """A sphere of a lobe at roughness 0.2 that the fit may not know, photographed with 1 % noise, and its answer."""
    truth = glossy("ball", (ggx_lobe if lobe == "ggx" else gaussian_lobe)(0.2), body=body, light=light)
    values, sd, usable = photograph(truth, SD)
    return truth, by_shape(values, truth, sd, usable, WITHOUT_TAIL)


@pytest.mark.parametrize("body", [HUE, turned_from_white(6.0), GREY])
def test_known_shape_separates_any_body(body: tuple[float, ...]) -> None:
    """60 dB and 0.3 % whatever the body's colour, grey too, where colour alone has nothing to say."""
    truth, found = answer("gaussian", body)
    psnr, relative = score(truth, (found.diffuse, found.specular))
    assert psnr > 60
    assert relative < 0.003
    assert found.agreed.preferred == "shape"
    assert not found.agreed.disagree


def test_where_the_lobes_fail_colour_is_preferred() -> None:
    """A long tail that no lobe allowed has: poor fit, and the layers differ as no known lobe's do."""
    truth, found = answer("ggx")
    assert Flag.POOR_FIT in found.fit.flags
    assert found.agreed.preferred == "colour"
    assert found.agreed.difference is not None
    assert found.agreed.difference > 0.05
    known = answer("gaussian")[1].agreed.difference
    assert known is not None
    assert known < 0.01
    values, sd, usable = photograph(truth, SD)
    grey = by_shape(values * 0 + values.mean(axis=2, keepdims=True), truth, sd, usable, WITHOUT_TAIL)
    assert grey.agreed.preferred == "shape"  # the same ball without hue: colour has no ground to stand on
    assert grey.agreed.difference is None


def test_a_body_of_varying_hue_does_not_pass_for_a_highlight() -> None:
    """Two degrees of hue from place to place: colour takes it for light, the two disagree, and shape is believed."""
    truth = glossy("ball", gaussian_lobe(0.05), body=turned_from_white(15.0), peak=0.2)
    row, column = np.mgrid[:256, :256] / 12.0
    hue = 1.0 + 0.05 * (np.sin(row) * np.cos(column))[..., None] * np.array([1.0, 0.0, -1.0])
    values, sd, usable = photograph(truth, SD / 5)
    found = by_shape(values + truth.diffuse * (hue - 1.0), truth, sd, usable, WITHOUT_TAIL)
    assert found.agreed.preferred == "shape"
    assert found.agreed.disagree
    plain = by_shape(values, truth, sd, usable, WITHOUT_TAIL)
    assert not plain.agreed.disagree


def test_the_light_s_colour_is_that_of_the_residual() -> None:
    """Warm light within 0.3 degrees and within four of its stated sds."""
    truth, found = answer("gaussian", HUE, WARM)
    assert found.light is not None
    error = off_deg(found.light.colour, truth.light_colour)
    assert error < 0.3
    assert error < 4 * found.light.sd_deg
    assert off_deg(np.array(WHITE), truth.light_colour) > 10  # what taking it for neutral would cost


def test_no_light_s_colour_where_the_fit_cannot_tell() -> None:
    """Not of a known irradiance, a metal, a highlight that was not seen, nor of a wide posterior."""
    fit = answer("gaussian", HUE, WARM)[1].fit
    strength = np.asarray(fit.draws["specular_strength"])
    noisy = strength * np.exp(0.3 * np.random.default_rng(0).standard_normal(strength.shape))
    assert light_colour(fit) is not None
    assert light_colour(replace(fit, scene=replace(fit.scene, scale="absolute"))) is None
    assert light_colour(replace(fit, flags=(Flag.NO_SPECULAR,))) is None
    assert light_colour(replace(fit, colours={**fit.colours, "diffuse_albedo": np.zeros(3)})) is None
    assert light_colour(replace(fit, draws={**fit.draws, "specular_strength": noisy})) is None
    assert light_colour(replace(fit, draws={})) is None
    neutral = np.repeat(strength[..., :1], 3, axis=-1)
    assert light_colour(replace(fit, draws={**fit.draws, "specular_strength": neutral})) is None
