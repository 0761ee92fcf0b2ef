"""`fit-material light`: a lamp read off mirror balls, told, and written as a scene file that a fit reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.cli import main
from pipelines.layers import read_settings
from tests.command import Run, runs
from tests.docs.console import ROOT
from tests.geometry.mirror_ball import photographed, traced

SCENE = ROOT / "docs" / "demo" / "chrome.toml"
TRUTH = np.array([0.55, 0.50, 0.669]) / np.linalg.norm([0.55, 0.50, 0.669])
FOCAL_PX = 2500.0
BALLS = [(-3.0, 0.0, -25.0), (3.0, 0.5, -26.0)]  # radii from the camera; the lamp as well
LAMP = np.array([9.0, 11.0, -8.0])


def _apart_deg(a: Any, b: Any) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))))


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the chrome ball of the documentation, with and without sidecar, and two balls under a near lamp."""
    place = tmp_path_factory.mktemp("light")
    assert main(["render", str(SCENE), "--out", str(place / "chrome.dng")]) == 0
    (place / "alone.dng").write_bytes((place / "chrome.dng").read_bytes())
    _write(place / "two.png", traced(BALLS, LAMP, lamp_radius=0.4, size=(500, 1000), focal_px=FOCAL_PX))
    _write(place / "one.png", traced(BALLS[:1], LAMP, lamp_radius=0.4, size=(500, 1000), focal_px=FOCAL_PX))
    _write(place / "moved.png", traced(BALLS[1:], LAMP, lamp_radius=0.4, size=(500, 1000), focal_px=FOCAL_PX))
    return place


def _write(path: Path, signal: Any) -> None:
    import cv2

    values = [plane.values for plane in photographed(0.004 + 0.8 * signal, seed=1).planes]
    cv2.imwrite(str(path), np.round(65535 * np.clip(np.stack(values, axis=-1), 0, 1)).astype(np.uint16))


@pytest.fixture
def run(photographs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command line in the folder of the photographs."""
    monkeypatch.chdir(photographs)
    return runs(capsys)


def _circle(ball: tuple[float, float, float]) -> str:
    x, y, z = ball
    radius = FOCAL_PX * np.tan(np.arcsin(1.0 / np.linalg.norm(ball)))
    return f"{499.5 + FOCAL_PX * x / -z:.3f},{249.5 - FOCAL_PX * y / -z:.3f},{radius:.3f}"


NEAR = (f"--set=camera.focal_length_px={FOCAL_PX}", "--set=sphere.centre_sd_px=0.02", "--set=sphere.radius_sd_px=0.02")


def test_a_render_of_the_documentation_tells_its_lamp_within_a_twentieth_of_a_degree(run: Run) -> None:
    """As one JSON object: the light as a scene file has it, its error, the ball, nothing on stderr that is no note."""
    code, out, err = run("light", "chrome.dng", "--json")
    told = json.loads(out)
    assert code == 0
    assert (told["schema"], told["status"], told["error"]) == ("fit-material/light/1", "ok", None)
    assert _apart_deg(told["light"]["direction"], TRUTH) < 0.05
    assert told["light"]["kind"] == "directional"
    (ball,) = told["balls"]
    assert abs(ball["angular_radius_deg"] - 1.0) < 3 * ball["angular_radius_sd_deg"]
    assert np.hypot(ball["sd_highlight_deg"], ball["sd_outline_deg"]) == pytest.approx(told["sd_deg"], rel=1e-6)
    assert all(line.startswith("note: ") for line in err.splitlines())


def test_the_scene_file_is_what_a_fit_takes(run: Run, tmp_path: Path) -> None:
    """Its light is the one told, to the last digit, with its sd; `--scene` puts it over the sidecar's."""
    scene = tmp_path / "lamp.toml"
    told = json.loads(run("light", "chrome.dng", "--out", str(scene), "--json")[1])
    (light,) = read_settings(scene).light
    np.testing.assert_allclose(light.direction, told["light"]["direction"], rtol=1e-9)
    assert light.direction_sd_deg == pytest.approx(told["sd_deg"], rel=5e-3)
    code, out, _ = run("chrome.dng", "--scene", str(scene), "--dry-run", "--json")
    planned = json.loads(out)["settings"]
    assert code == 0
    assert planned["light"][0]["direction"] == list(light.direction)
    assert planned["light"][0]["irradiance"] is None
    assert planned["sphere"]["radius_px"] == 120.4


def test_nothing_is_overwritten_unasked(run: Run, tmp_path: Path) -> None:
    """Exit 2 and the file as it was; with --overwrite replaced; never a folder."""
    scene = tmp_path / "lamp.toml"
    scene.write_text("# mine\n")
    code, out, err = run("light", "chrome.dng", "--out", str(scene))
    assert (code, out, scene.read_text()) == (2, "", "# mine\n")
    assert "--overwrite" in err
    assert run("light", "chrome.dng", "--out", str(scene), "--overwrite", "-q") == (0, "", "")
    assert read_settings(scene).light
    assert run("light", "chrome.dng", "--out", str(tmp_path), "--overwrite")[0] == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lamp.toml"]


@pytest.mark.parametrize(
    "words",
    [
        ("two.png", f"--sphere={_circle(BALLS[0])}", f"--sphere={_circle(BALLS[1])}"),
        ("one.png", "moved.png", f"--sphere={_circle(BALLS[0])}", f"--sphere={_circle(BALLS[1])}"),
    ],
    ids=["two balls", "two photographs"],
)
def test_two_balls_or_two_photographs_place_a_near_lamp(run: Run, words: tuple[str, ...], tmp_path: Path) -> None:
    """Position from the first ball within 3.5 of its stated sds and 2 %, as a point light that a fit reads."""
    scene = tmp_path / "lamp.toml"
    code, out, err = run("light", *words, *NEAR, "--json", "--out", str(scene))
    told = json.loads(out)
    truth = LAMP - np.array(BALLS[0])
    off = np.array(told["light"]["position"]) - truth
    assert code == 0
    assert off @ np.linalg.solve(told["position_covariance"], off) < 16.3  # chi-square of 3, 99.9 %
    assert np.linalg.norm(off) < 0.02 * np.linalg.norm(truth)
    assert told["distance_radii"]["estimate"] == pytest.approx(np.linalg.norm(truth), rel=0.02)
    assert len(told["balls"]) == 2
    assert "put the ball to be fitted in that ball's place" in err
    (light,) = read_settings(scene).light
    assert light.kind == "point"


def test_a_person_reads_where_the_lamp_stands_and_how_well_it_is_known(run: Run) -> None:
    """Direction, error, size and the ball, in lines."""
    code, out, err = run("light", "chrome.dng")
    assert code == 0
    assert out.startswith("direction         0.5")
    for words in ("± ", "angular radius", "highlight", "by the outline", "perspective"):
        assert words in out
    assert "tells the distance" in err


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("missing.dng",), 3, "no such file"),
        ((".",), 3, "a folder"),
        ((str(SCENE),), 3, "chrome.toml: "),
        (("chrome.dng", "chrome.dng"), 2, "named twice"),
        (("chrome.dng", "alone.dng", "--sphere=1,2,3"), 2, "found 1 for 2 photographs"),
        (("chrome.dng", "--sphere=1,2"), 2, "expected CX,CY,R"),
        (("chrome.dng", "--sphere=205,154,nan"), 2, "expected a finite number"),
        (("chrome.dng", "--sphere=205,154,-3"), 2, "expected a number > 0"),
        (("chrome.dng", "--sphere=5000,20,100"), 3, "outside the 400 x 320 frame"),
        (("chrome.dng", "--sphere=80,200,40"), 3, "no highlight on the ball"),
        (("chrome.dng", "--set=sphere.size=3"), 2, "unknown key sphere.size"),
        (("chrome.dng", "--out", "no/where.toml"), 2, "does not exist"),
        (("chrome.dng", "--transfer=srgb"), 2, "linear already"),
        (("alone.dng",), 3, "--sphere CX,CY,R"),
        ((str(ROOT / "docs" / "demo" / "demo.dng"),), 3, "glossy, not a mirror"),
        (("two.png", f"--sphere={_circle(BALLS[1])}", f"--sphere={_circle(BALLS[0])}x"), 2, "expected CX,CY,R"),
    ],
)
def test_a_mistake_gets_one_line(run: Run, words: tuple[str, ...], code: int, says: str) -> None:
    """What was found, what was expected, the exit code; nothing on stdout."""
    found, out, err = run("light", *words)
    assert (found, out) == (code, ""), err
    assert says in err
    assert len(err.splitlines()) == 1


def test_two_lamps_are_not_told_as_one(run: Run) -> None:
    """Where the rays of two photographs cannot meet, exit 3; a failure is an object too."""
    words = ("one.png", "chrome.dng", f"--sphere={_circle(BALLS[0])}", "--sphere=205.6,154.3,120.4", *NEAR, "--json")
    code, out, err = run("light", *words)
    assert code == 3
    assert "expected" in err
    assert json.loads(out)["status"] == "failed"
