"""The result object: its schema, its bytes, and strings and numbers that want to spoil them."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.report.result import failure_object, finite, result_object, result_text
from pipelines.settings import Settings, SphereTable
from tests.pipelines import fakes
from toolkit.geometry.lights import PointLight
from toolkit.inference.moved_light import MovedLight, moved
from toolkit.records import Camera, MaterialReport

SEPARATION = {
    *("method", "body_colour", "light_colour", "light_source", "light_reason", "light_sd_deg"),
    *("angle_deg", "angle_sd_deg", "flags", "preferred", "reason", "difference"),
}
TOP = [
    "schema",
    "status",
    "error",
    "flags",
    "image",
    "camera",
    "noise",
    "scale",
    "reference",
    "colour",
    "sphere",
    "lights",
    "separation",
    "fits",
    "best",
    "preferred",
    "elpd_difference",
    "software",
]
FIT = [
    "model",
    "variant",
    "diffuse",
    "status",
    "flags",
    "chi2_reduced",
    "elpd",
    "bic",
    "tempering",
    "parameters",
    "calibration",
    "posterior",
]
PARAMETER = {
    "estimate",
    "mode",
    "sd",
    "sd_statistical",
    "interval_68",
    "interval_90",
    "unit",
    "posterior_to_prior",
    "flags",
    "srgb",
}


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report()


def test_the_object_has_every_key_of_the_schema_in_its_order(report: MaterialReport) -> None:
    """Top level, fits, parameters and posterior hold exactly the documented keys."""
    result = result_object(report)
    assert list(result) == TOP
    assert set(result["image"]) == {"name", "sha256", "width_px", "height_px", "camera", "colour_space"}
    assert set(result["sphere"]) == {"centre_px", "radius_px", "source", "given", "sd"}
    assert set(result["separation"]) == SEPARATION
    assert set(result["elpd_difference"]) == {"value", "sd"}
    for fit in result["fits"]:
        assert list(fit) == FIT
        shown = {"samples", "ess_min", "r_hat_max", "tau_max", "acceptance", "seed", "quadrature_error"}
        assert set(fit["posterior"]) == shown
        assert all(set(parameter) == PARAMETER for parameter in fit["parameters"].values())


def test_colours_are_lists_and_intervals_are_shaped_like_their_estimates(report: MaterialReport) -> None:
    """A colour's estimate has one number a channel and so has each end of its intervals."""
    parameters = result_object(report)["fits"][0]["parameters"]
    assert isinstance(parameters["roughness_rad"]["estimate"], float)
    assert np.shape(parameters["roughness_rad"]["interval_90"]) == (2,)
    assert np.shape(parameters["diffuse_albedo"]["estimate"]) == (3,)
    assert np.shape(parameters["diffuse_albedo"]["interval_68"]) == (2, 3)


def test_numbers_survive_the_way_into_the_object(report: MaterialReport) -> None:
    """What the report says of the best fit is what a reader of the JSON finds."""
    result = json.loads(result_text(result_object(report)))
    albedo = next(p for p in report.fits[0].parameters if p.name == "diffuse_albedo")
    np.testing.assert_allclose(
        result["fits"][0]["parameters"]["diffuse_albedo"]["estimate"], albedo.estimate, rtol=1e-9
    )
    assert result["sphere"]["centre_px"] == list(report.scene.sphere.centre_px)
    assert result["lights"][0]["source"] == "given"
    assert result["lights"][0]["fitted"]["direction"] != result["lights"][0]["direction"]
    for name, (shift, sd) in report.fits[0].nuisances.items():
        assert result["fits"][0]["calibration"][name] == pytest.approx({"shift": shift, "sd": sd}, rel=1e-9)
    assert result["software"]["numpy"] == np.__version__


def test_the_same_report_gives_the_same_bytes_and_they_read_back(report: MaterialReport) -> None:
    """The text ends with a newline, is strict JSON, and is a function of the report alone."""
    text = result_text(result_object(report))
    assert text == result_text(result_object(fakes.report()))
    assert text.endswith("}\n")
    assert json.loads(text) == result_object(report)
    assert result_text(result_object(report), indent=None).count("\n") == 1


def test_another_seed_gives_other_bytes(report: MaterialReport) -> None:
    """The bytes do depend on the draws."""
    assert result_text(result_object(report)) != result_text(result_object(fakes.report(seed=1)))


def test_what_is_not_finite_becomes_null() -> None:
    """NaN and infinity never reach the JSON, at any depth, and booleans stay booleans."""
    given = {"a": np.nan, "b": [np.inf, np.array([1.0, -np.inf])], "c": np.float32(0.5), "d": np.bool_(True), "e": 3}
    assert finite(given) == {"a": None, "b": [None, [1.0, None]], "c": 0.5, "d": True, "e": 3}
    assert finite(np.array(2.5)) == 2.5


def test_a_parameter_that_is_not_identified_is_null_throughout(report: MaterialReport) -> None:
    """All its fields are there, and none holds a number that was not measured."""
    blind = replace(
        report.fits[0].parameters[3],
        **dict.fromkeys(("estimate", "mode", "sd", "sd_statistical", "interval_68", "interval_90")),
        posterior_to_prior=np.ones(3),
        note="one light",
    )
    fit = replace(report.fits[0], parameters=(*report.fits[0].parameters[:3], blind), chi2_reduced=math.nan)
    result = result_object(replace(report, fits=(fit,)))["fits"][0]
    assert result["chi2_reduced"] is None
    assert result["parameters"]["specular_f0"]["estimate"] is None
    assert set(result["parameters"]["specular_f0"]) == PARAMETER


def test_what_a_report_lacks_is_null_or_empty(report: MaterialReport) -> None:
    """No separation, no comparison, no sampling: the keys stay."""
    fit = replace(report.fits[0], diagnostics=None)
    bare = replace(report, separation=None, fits=(fit,), preferred=None, elpd_difference=None)
    result = result_object(bare)
    assert list(result) == TOP
    assert result["separation"] is None
    assert result["preferred"] is None
    assert result["elpd_difference"] == {"value": None, "sd": None}
    assert set(result["fits"][0]["posterior"].values()) == {None}


def test_a_point_light_carries_its_position_as_given_and_as_fitted(report: MaterialReport) -> None:
    """A fitted light knows its direction and its nearness; the result turns these into a place."""
    lamp = PointLight(position=(0.0, 3.0, 4.0))
    moved = MovedLight(kind="point", direction=(0.0, 0.6, 0.8), nearness=0.25, irradiance=None, angular_radius_deg=0.0)
    fit = replace(report.fits[0], scene=replace(report.fits[0].scene, lights=(moved,)))
    light = result_object(replace(report, scene=replace(report.scene, lights=(lamp,)), fits=(fit,)))["lights"][0]
    assert light["position"] == [0.0, 3.0, 4.0]
    assert light["direction"] == [0.0, 0.6, 0.8]
    np.testing.assert_allclose(light["fitted"]["position"], [0.0, 2.4, 3.2])
    tilts = [report.fits[0].nuisances[f"light0.tilt_{axis}_rad"][1] for axis in "xy"]
    assert light["fitted"]["sd_deg"] == pytest.approx(math.degrees(math.hypot(*tilts) / math.sqrt(2)))


def test_a_fitted_light_says_all_that_the_body_sees_of_it(report: MaterialReport) -> None:
    """Its irradiance and what comes back of it as they were fitted; null where nothing does."""
    plain = result_object(report)["lights"][0]["fitted"]
    assert (plain["irradiance"], plain["returned"]) == (list(fakes.IRRADIANCE), None)
    light = moved(fakes.LIGHT, scale=(1.0, 0.5, 2.0), returned=(0.004, -0.02, 0.0))
    fit = replace(report.fits[0], scene=replace(report.fits[0].scene, lights=(light,)))
    result = result_object(replace(report, fits=(fit,)))["lights"][0]
    assert result["fitted"]["returned"] == [0.004, -0.02, 0.0]
    assert result["fitted"]["irradiance"] == [2.4, 2.2, 6.2]
    assert result["irradiance"] == list(fakes.IRRADIANCE)


def test_a_perspective_camera_says_its_focal_length(report: MaterialReport) -> None:
    """Projection, focal length and principal point, in pixels."""
    camera = Camera(projection="perspective", focal_length_px=900.0, principal_point_px=(160.0, 120.0))
    told = result_object(replace(report, scene=replace(report.scene, camera=camera)))["camera"]
    assert told == {"projection": "perspective", "focal_length_px": 900.0, "principal_point_px": [160.0, 120.0]}


def test_the_users_own_sphere_stands_beside_the_one_used(report: MaterialReport) -> None:
    """`given` is what the settings say, null where they say nothing."""
    settings = Settings(sphere=SphereTable(centre_px=(10.0, 20.0), radius_px=5.0))
    assert result_object(report, settings)["sphere"]["given"]["centre_px"] == [10.0, 20.0]
    assert result_object(report, Settings())["sphere"]["given"] is None


def test_hostile_strings_stay_strings() -> None:
    """Control characters, surrogates and line breaks are gone; the text is valid UTF-8 and JSON on any reader."""
    text = result_text(result_object(fakes.hostile_report()))
    result: dict[str, Any] = json.loads(text.encode("utf-8"))
    told = [result["image"]["name"], result["image"]["camera"], *result["flags"], result["fits"][1]["status"]]
    assert all(character.isprintable() for line in told for character in line)
    assert "/" not in result["image"]["name"]


def test_a_failure_has_the_same_keys_and_one_line_of_error() -> None:
    """A reader of many results needs no special case for the failed ones."""
    failed = failure_object("/some/where/ball.dng", ValueError("no sphere\nfound"))
    assert list(failed) == TOP
    assert failed["status"] == "failed"
    assert failed["error"] == "no sphere found"
    assert failed["image"]["name"] == "ball.dng"
    assert failed["fits"] == []
    assert failure_object("x", ValueError())["error"] == "ValueError"
