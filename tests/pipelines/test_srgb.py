"""Reflectances in sRGB through the whole main job: by a chart, by the file's matrix, or not at all."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.fit_material import fit_material
from pipelines.report.result import result_object
from pipelines.srgb import light_of, srgb_of
from synthetic.camera import Sensor
from synthetic.photograph import write_raw
from tests.pipelines import fakes
from tests.pipelines.test_reference import EXPOSURE, LIGHT_COLOUR, NOISE, SIZE_PX, coloured_scene, raw_of, settings
from tests.radiometry.test_chart import CAMERA, painted
from toolkit.errors import BadInputError
from toolkit.radiometry.colour import XYZ_TO_SRGB
from toolkit.records import Camera


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ball.dng, and chart.dng of a camera whose matrix is known."""
    from synthetic.render import render
    from tests.inference.ball import glossy

    place = tmp_path_factory.mktemp("srgb")
    picture = render(coloured_scene(), glossy(), width_px=SIZE_PX, height_px=SIZE_PX, supersample=4)
    write_raw(place / "ball.dng", raw_of(EXPOSURE * picture.radiance(), 1), NOISE, Sensor(), Camera())
    chart = painted() / np.array([0.9, 1.6, 1.1]) * LIGHT_COLOUR / LIGHT_COLOUR.max()
    write_raw(place / "chart.dng", raw_of(chart, 3), NOISE, Sensor(), Camera())
    return place


def test_a_chart_tells_matrix_and_light(folder: Path) -> None:
    """Its matrix, not the file's; its greys as the light's colour; the relative albedos without the light's colour."""
    report = fit_material(folder / "ball.dng", settings(colour={"chart": "chart.dng"}))
    assert report.colour is not None
    assert report.colour.source == "chart"
    assert report.colour.chart_sha256 == hashlib.sha256((folder / "chart.dng").read_bytes()).hexdigest()
    known = np.linalg.inv(CAMERA / CAMERA.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(report.colour.to_srgb, known, atol=0.05)
    assert report.separation is not None
    assert report.separation.light_source == "card"
    np.testing.assert_allclose(light_of(report), LIGHT_COLOUR / LIGHT_COLOUR.max(), rtol=0.02)
    found = result_object(report)
    albedo = found["fits"][0]["parameters"]["diffuse_albedo"]
    assert albedo["unit"] == "relative"
    assert albedo["srgb"]["hex"] is None
    expected = known @ np.array([0.45, 0.2, 0.08])
    srgb = np.array(albedo["srgb"]["estimate"])
    np.testing.assert_allclose(srgb / srgb.sum(), expected / expected.sum(), atol=0.02)
    np.testing.assert_allclose(XYZ_TO_SRGB @ np.array(albedo["srgb"]["xyz"]), srgb, rtol=1e-6)
    assert found["colour"]["delta_e"] < 1.5
    by_file = fit_material(folder / "ball.dng", settings())
    assert by_file.colour is not None
    assert by_file.colour.source == "colour-matrix"


def test_a_chart_that_is_missing_or_none_is_one_line(folder: Path) -> None:
    """No such file; a photograph without a chart."""
    for name, line in (("none.dng", "does not exist"), ("ball.dng", "no 24-patch colour chart found")):
        with pytest.raises(BadInputError, match=line):
            fit_material(folder / "ball.dng", settings(colour={"chart": name}))


def test_sds_in_srgb_are_those_of_the_draws() -> None:
    """The matrix times the draws' covariance; white is white; nothing is told of an unknown camera."""
    report = fakes.report()
    fit = report.fits[0]
    albedo = next(p for p in fit.parameters if p.name == "diffuse_albedo")
    found = srgb_of(report, fit, albedo)
    assert found is not None
    assert report.colour is not None
    covariance = report.colour.to_srgb @ np.cov(fit.draws["diffuse_albedo"].reshape(-1, 3).T) @ report.colour.to_srgb.T
    np.testing.assert_allclose(found.sd, np.sqrt(np.diag(covariance)), rtol=1e-9)
    white = srgb_of(report, fit, replace(albedo, estimate=np.ones(3)))
    assert white is not None
    assert white.hex == "#ffffff"
    assert srgb_of(replace(report, colour=None), fit, albedo) is None
    pedestal = next(p for p in fit.parameters if p.name == "pedestal")
    assert srgb_of(report, fit, pedestal) is None
