"""The scene file and its options: merged in order, strict, told of in one line, written and read back identically."""

from __future__ import annotations

import datetime
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipelines.layers import Layer, assignment, preset_names, read_layer, read_settings, resolve, settings_of
from pipelines.settings import Settings, camera_of, dumps, lights_of, model_and_variant, noise_of_settings, sphere_of
from toolkit.errors import BadInputError, FitMaterialError, UsageError
from toolkit.records import Metadata

BALL: dict[str, Any] = {"sphere": {"centre_px": [10.0, 20.0], "radius_px": 8.0}}


def settings(values: dict[str, Any], *more: Layer) -> Settings:
    return settings_of([Layer(name="ball.toml", values=values), *more])


def message(values: dict[str, Any], *more: Layer) -> str:
    with pytest.raises(FitMaterialError) as caught:
        settings(values, *more)
    text = str(caught.value)
    assert "\n" not in text
    assert text.isprintable()
    return text


numbers = st.floats(-1e9, 1e9)
positive = st.floats(1e-12, 1e9)
triples = st.lists(positive, min_size=3, max_size=3)
pairs = st.lists(numbers, min_size=2, max_size=2)
directions = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 1e-3)
positions = st.lists(st.floats(-1e4, 1e4), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 1.001)
own = {"direction_sd_deg": st.floats(0.01, 9), "irradiance": triples, "angular_radius_deg": st.floats(0, 5)}
light_tables = st.one_of(
    st.fixed_dictionaries({"kind": st.just("directional"), "direction": directions}, optional=own),
    st.fixed_dictionaries({"kind": st.just("point"), "position": positions}, optional=own),
)
scene_files = st.fixed_dictionaries(
    {},
    optional={
        "camera": st.fixed_dictionaries(
            {},
            optional={
                "projection": st.sampled_from(["orthographic", "perspective"]),
                "focal_length_px": positive,
                "principal_point_px": pairs,
            },
        ),
        "sphere": st.fixed_dictionaries(
            {"centre_px": pairs, "radius_px": positive}, optional={"centre_sd_px": positive, "radius_sd_px": positive}
        ),
        "light": st.lists(light_tables, max_size=3),
        "noise": st.fixed_dictionaries({"gain": st.one_of(positive, triples), "read": st.one_of(positive, triples)}),
        "image": st.fixed_dictionaries({}, optional={"transfer": st.just("srgb"), "width_px": st.integers(16, 9999)}),
        "material": st.fixed_dictionaries(
            {"parameters": st.dictionaries(st.text(max_size=9), st.one_of(numbers, triples), max_size=3)},
            optional={"model": st.sampled_from(["phong", "ggx:masking=smith"])},
        ),
        "separation": st.fixed_dictionaries({}, optional={"illuminant": triples}),
        "fit": st.fixed_dictionaries(
            {},
            optional={
                "models": st.lists(st.sampled_from(["phong", "ggx", "ggx:masking=v-groove"]), min_size=1, max_size=3),
                "seed": st.integers(0, 2**32 - 1),
                "fix": st.lists(st.sampled_from(["light", "radius"]), max_size=3),
                "specular": st.sampled_from(["neutral", "coloured"]),
                "discrepancy": st.sampled_from(["on", "off"]),
            },
        ),
    },
)


@given(scene_files)
def test_complete_settings_are_written_and_read_back_identically(values: dict[str, Any]) -> None:
    """TOML out, TOML in: the same record, to the last bit, and the same text again."""
    whole = settings(values)
    text = dumps(whole)
    again = settings_of([Layer(name="again.toml", values=tomllib.loads(text))])
    assert again == whole
    assert dumps(again) == text


def test_layers_merge_in_order(tmp_path: Path) -> None:
    """Defaults < preset < sidecar < scene file < flags, key by key."""
    (tmp_path / "ball.dng.toml").write_text("[sphere]\ncentre_px = [1, 2]\nradius_px = 3\n[fit]\ness = 700\nseed = 1\n")
    (tmp_path / "scene.toml").write_text("[sphere]\nradius_px = 4\n[fit]\nseed = 2\n")
    flags = [assignment("fit.seed=3")]
    whole = resolve(tmp_path / "ball.dng", presets=["quick"], scene=tmp_path / "scene.toml", flags=flags)
    assert whole.sphere is not None
    assert (whole.sphere.centre_px, whole.sphere.radius_px) == ((1.0, 2.0), 4.0)
    assert (whole.fit.models, whole.fit.ess, whole.fit.seed) == (("torrance-sparrow", "ggx"), 700, 3)


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_valid(name: str) -> None:
    """A preset that ships can be used as it is."""
    assert resolve(presets=[name]).fit.models


def test_the_preset_standard_is_what_runs_without_one() -> None:
    """`--preset standard` changes nothing."""
    assert resolve(presets=["standard"]) == resolve()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"sphere": {"centre_px": [1, 2], "radius_px": -3}},
            "ball.toml: sphere.radius_px is -3; expected a number > 0",
        ),
        ({"sphere": {"centre_px": [1], "radius_px": 3}}, "ball.toml: sphere.centre_px is [1]; expected 2 numbers"),
        (
            {"sphere": {"centre_px": [1, 2], "radius": 3}},
            "ball.toml: unknown key sphere.radius; did you mean radius_px?",
        ),
        ({"sphre": {}}, "ball.toml: unknown key sphre; did you mean sphere?"),
        ({"sphere": {"radius_px": 3}}, "ball.toml: sphere.centre_px is missing; expected it in [sphere]"),
        ({"light": [{"kind": "lazer"}]}, 'ball.toml: light.0.kind is "lazer"; expected one of'),
        (
            {"light": [{"kind": "directional", "direction": [0, 0, 1], "irradience": 1}]},
            "ball.toml: unknown key light.0.irradience; did you mean irradiance?",
        ),
        (
            {"light": [{"kind": "directional", "direction": [0, 0, float("nan")]}]},
            "ball.toml: light.0.direction.2 is NaN; expected a finite number",
        ),
        ({"light": [{"kind": "directional", "direction": [0, 0, 0]}]}, "has no length"),
        ({"noise": {"gain": float("inf"), "read": 1}}, "ball.toml: noise.gain is Infinity; expected a finite number"),
        ({"noise": {"gain": True, "read": 1}}, "ball.toml: noise.gain is true; expected a number, or three"),
        ({"noise": {"gain": 1e-4, "read": 0}}, "ball.toml: noise.read is 0; expected a number > 0"),
        ({"camera": {"focal_length_px": "4200"}}, 'ball.toml: camera.focal_length_px is "4200"; expected a number'),
        ({"camera": {"focal_length_px": 10**400}}, "expected a finite number"),
        ({"camera": {"focal_length_px": 1e-308}}, "camera.focal_length_px is 1e-308; expected a number >= 1e-12"),
        ({"camera": {"focal_length_px": datetime.date(2020, 1, 1)}}, '"2020-01-01"; expected a number'),
        ({"fit": {"models": []}}, "ball.toml: fit.models is []; expected at least 1 value(s)"),
        ({"fit": {"models": ["gxx"]}}, "'gxx' is no specular model; expected one of"),
        ({"fit": {"models": ["ggx:masking=smit"]}}, "ball.toml: fit.models.0: ggx:masking='smit'; expected one of"),
        ({"fit": {"diffuse": ["ggx"]}}, "'ggx' is no diffuse model; expected one of"),
        ({"fit": {"seed": 1.5}}, "ball.toml: fit.seed is 1.5; expected a whole number"),
        ({"material": {"parameters": {"a": "x"}}}, 'ball.toml: material.parameters.a is "x"; expected'),
        ({"\x1b[31m": 3}, "ball.toml: unknown key \\x1b[31m"),
        ({"sphere": 3}, "ball.toml: sphere is 3; expected a table"),
        ({"light": {}}, "ball.toml: light is {}; expected a list"),
    ],
)
def test_a_mistake_is_one_line_with_file_key_found_and_expected(values: dict[str, Any], line: str) -> None:
    """The line names the file, the key, what was found there and what was expected."""
    assert line in message(values)


def test_a_mistake_is_charged_to_the_layer_that_made_it() -> None:
    """A flag's mistake is a usage error and names the flag; a file's is bad input and names the file."""
    with pytest.raises(UsageError, match=r"^--set: sphere\.radius_px is -1; expected a number > 0$"):
        settings(BALL, assignment("sphere.radius_px=-1"))
    with pytest.raises(BadInputError, match=r"^ball\.toml: sphere\.radius_px is 0;"):
        settings({"sphere": {"centre_px": [1, 2], "radius_px": 0}}, assignment("fit.seed=1"))


def test_set_reaches_into_lists_by_number() -> None:
    """`--set light.0.key=value` changes one light and leaves the rest of it."""
    scene = {"light": [{"kind": "directional", "direction": [0, 0, 1]}]}
    whole = settings(scene, assignment("light.0.irradiance=[1, 2, 3]"))
    assert lights_of(whole)[0].irradiance == (1.0, 2.0, 3.0)
    with pytest.raises(UsageError, match="a number from 0 to 0"):
        settings(scene, assignment("light.1.irradiance=[1, 2, 3]"))


@pytest.mark.parametrize("text", ["a", "a=3", ".a=3", "sphere.=1", "=1"])
def test_an_assignment_of_another_form_is_refused(text: str) -> None:
    """--set wants TABLE.KEY=VALUE."""
    with pytest.raises(UsageError, match=r"expected TABLE\.KEY=VALUE"):
        assignment(text)


def test_an_assignment_holds_one_value_only() -> None:
    """A newline in a value smuggles no second key in."""
    assert assignment("camera.projection=1\nx=2").values == {"camera": {"projection": "1\nx=2"}}


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"\xff\xfe", "expected a scene file in TOML"),
        (b"[sphere", "expected a scene file in TOML"),
        (b"a = " + b"[" * 100_000, "expected a scene file in TOML"),
        (b"a = " + b"9" * 10_000, "expected a scene file in TOML"),
        (b"#" * (1 << 18) + b"\n", "larger than 256 KiB"),
    ],
)
def test_a_file_that_is_no_scene_file_is_refused_in_one_line(tmp_path: Path, data: bytes, line: str) -> None:
    """Not UTF-8, not TOML, nested or long beyond reason, too large."""
    path = tmp_path / "bad.toml"
    path.write_bytes(data)
    with pytest.raises(BadInputError, match=line) as caught:
        read_layer(path)
    assert str(caught.value).startswith("bad.toml")
    assert "\n" not in str(caught.value)


def test_a_missing_scene_file_is_refused(tmp_path: Path) -> None:
    """It is bad input, not a traceback."""
    with pytest.raises(BadInputError, match=r"none\.toml: cannot be read: No such file"):
        read_settings(tmp_path / "none.toml")


def test_an_unknown_preset_names_those_there_are() -> None:
    """A preset's name cannot leave the presets' folder either."""
    with pytest.raises(UsageError, match="expected one of careful, quick, standard"):
        resolve(presets=["../settings"])


def test_a_model_may_name_its_variant() -> None:
    """NAME:OPTION=CHOICE, options repeatable."""
    assert model_and_variant("ggx") == ("ggx", {})
    assert model_and_variant("ggx:masking=smith") == ("ggx", {"masking": "smith"})
    with pytest.raises(ValueError, match="expected NAME or NAME:OPTION=CHOICE"):
        model_and_variant("ggx:smith")


def test_a_given_sphere_has_default_sds() -> None:
    """0.5 px where nothing is said, else what is said; none given: to be detected."""
    sphere = sphere_of(settings(BALL))
    assert sphere is not None
    np.testing.assert_allclose(np.sqrt(np.diag(sphere.covariance_px2)), [0.5, 0.5, 0.5])
    sphere = sphere_of(settings(BALL, assignment("sphere.radius_sd_px=0.1")))
    assert sphere is not None
    np.testing.assert_allclose(np.sqrt(np.diag(sphere.covariance_px2)), [0.5, 0.5, 0.1])
    assert sphere_of(settings({})) is None


def test_one_noise_number_stands_for_three_channels() -> None:
    """Given noise becomes a record; none given stays None."""
    noise = noise_of_settings(settings({"noise": {"gain": 1e-4, "read": [1e-3, 2e-3, 3e-3]}}))
    assert noise is not None
    np.testing.assert_array_equal(noise.gain, [1e-4] * 3)
    np.testing.assert_array_equal(noise.read, [1e-3, 2e-3, 3e-3])
    assert noise_of_settings(settings({})) is None


def test_the_camera_is_completed_from_frame_and_exif() -> None:
    """Orthographic where no focal length is known; the principal point lies in the frame's middle."""
    assert camera_of(settings({}), width_px=36, height_px=24).projection == "orthographic"
    given = camera_of(settings({"camera": {"focal_length_px": 50.0}}), width_px=101, height_px=51)
    assert (given.projection, given.focal_length_px, given.principal_point_px) == ("perspective", 50.0, (50.0, 25.0))
    exif = Metadata(focal_length_mm=50.0, focal_plane_resolution_px_per_mm=200.0)
    assert camera_of(settings({}), width_px=36, height_px=24, metadata=exif).focal_length_px == 10_000.0
    full_frame = camera_of(
        settings({}), width_px=3600, height_px=2400, metadata=Metadata(focal_length_35mm_mm=50.0)
    ).focal_length_px
    assert full_frame == pytest.approx(5000.0, rel=1e-3)  # 100 pixels a millimetre of the 36 mm frame
    asked = settings({"camera": {"projection": "orthographic"}})
    assert camera_of(asked, width_px=36, height_px=24, metadata=exif).projection == "orthographic"
    with pytest.raises(BadInputError, match=r"expected camera\.focal_length_px"):
        camera_of(settings({"camera": {"projection": "perspective"}}), width_px=36, height_px=24)
