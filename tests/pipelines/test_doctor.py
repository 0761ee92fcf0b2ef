"""`fit-material doctor`: what a photograph of known truth is told to lack, and that a good one lacks nothing."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.cli import main
from pipelines.doctor.exposure import exposure_of
from pipelines.doctor.picture import OUTLINE
from tests.command import Run, runs
from tests.realdata import folder
from toolkit.geometry.project import limb_px
from toolkit.records import Camera, Sphere

SCENE = """
[image]
width_px = 560
height_px = 500
exposure = 1.0
background = [0.004, 0.004, 0.004]
[camera]
projection = "perspective"
focal_length_px = 9000.0
[sphere]
centre_px = [275.3, 246.8]
radius_px = 205.0
centre_sd_px = 0.1
radius_sd_px = 0.1
[[light]]
kind = "directional"
direction = [-0.3687, 0.4394, 0.8192]
direction_sd_deg = 0.3
irradiance = [2.3, 4.8, 3.1]
[noise]
gain = 5e-5
read = 2e-4
[material]
model = "torrance-sparrow"
[material.parameters]
roughness_rad = 0.12
specular_f0 = 0.04
diffuse_albedo = [0.3, 0.16, 0.05]
"""
PEAK = 0.80  # of white, that the scene's highlight reaches in green


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the good photograph and its sidecar."""
    place = tmp_path_factory.mktemp("doctor")
    (place / "scene.toml").write_text(SCENE)
    assert main(["render", str(place / "scene.toml"), "--out", str(place / "ball.dng")]) == 0
    return place


@pytest.fixture
def run(good: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Run the command line in a folder of its own with scene file, photograph and sidecar."""
    monkeypatch.chdir(tmp_path)
    for path in good.iterdir():
        Path(path.name).write_bytes(path.read_bytes())
    return runs(capsys)


@pytest.fixture
def examined(run: Run) -> Callable[..., dict[str, Any]]:
    """Render the scene with changes and examine it: `examined({"image.exposure": "2"}, "--light=0,0,1")`."""

    def call(changes: dict[str, str] | None = None, *words: str, code: int = 0) -> dict[str, Any]:
        sets = [f"--set={key}={value}" for key, value in (changes or {}).items()]
        if sets:
            assert run("render", "scene.toml", "--out", "ball.dng", "--overwrite", *sets)[0] == 0
        found, out, _ = run("doctor", "ball.dng", "--no-report", "--json", *words)
        assert found == code
        told: dict[str, Any] = json.loads(out)
        return told

    return call


def _advised(told: dict[str, Any], words: str) -> list[dict[str, Any]]:
    return [one for one in told["advice"] if words in one["do"]]


def test_a_good_photograph_is_told_to_be_good(run: Run) -> None:
    """Nothing to change; page, picture and object stand in ./STEM.doctor/; the page asks nothing of the network."""
    code, out, err = run("doctor", "ball.dng")
    assert (code, err) == (0, "")
    assert out.startswith("ball.dng: Good to fit: nothing to change.\n")
    assert "raw, mosaic, linear" in out
    assert sorted(path.name for path in Path("ball.doctor").iterdir()) == [
        "ball.doctor.html",
        "ball.doctor.json",
        "ball.doctor.png",
    ]
    told = json.loads(Path("ball.doctor/ball.doctor.json").read_text())
    assert (told["schema"], told["status"], told["error"]) == ("fit-material/doctor/1", "ok", None)
    assert told["advice"] == []
    assert told["exposure"]["clipped_share"] == [0.0, 0.0, 0.0]
    assert told["noise"]["gain"] == [5e-05, 5e-05, 5e-05]
    assert np.hypot(*np.subtract(told["light"]["expected_px"], told["light"]["seen_px"])) < 3.0
    page = Path("ball.doctor/ball.doctor.html").read_text()
    assert "Nothing to change." in page
    assert "<script" not in page
    assert not re.findall(r'(?:src|href)="(?!data:|#)', page)


def test_the_outline_is_drawn_on_the_limb(run: Run) -> None:
    """In both pictures: its colour at every twentieth of the turn, and not a few pixels further out."""
    from PIL import Image

    assert run("doctor", "ball.dng", "-q") == (0, "", "")
    page = Path("ball.doctor/ball.doctor.html").read_text()
    frame, close = (
        np.asarray(Image.open(io.BytesIO(base64.b64decode(found))), float)
        for found in re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    )
    camera = Camera(projection="perspective", focal_length_px=9000.0, principal_point_px=(279.5, 249.5))
    sphere = Sphere(centre_px=(275.3, 246.8), radius_px=205.0, covariance_px2=np.eye(3), source="given")
    limb = limb_px(camera, sphere, count=20)
    step = 560 / frame.shape[1]
    assert step == 2.0  # quads
    _check_outline(frame, (limb - 0.5) / step)
    corner = np.array([9.0, 0.0])  # of the close picture, quads: 1.25 radii left of the centre, and the frame's top
    assert close.shape[:2] == (750, 774)  # 250 x 258 quads, three times as large
    _check_outline(close, ((limb - 0.5) / 2 - corner + 0.5) * 3 - 0.5)
    written = np.asarray(Image.open("ball.doctor/ball.doctor.png"), float)
    np.testing.assert_array_equal(written, close)


def _check_outline(picture: Any, places: Any) -> None:
    middle = places.mean(axis=0)
    beyond = middle + (places - middle) * (1 + 8 / np.hypot(*(places[0] - middle)))
    for at, there in ((places, True), (beyond, False)):
        column, row = np.rint(at).astype(int).T
        near = [picture[r - 1 : r + 2, c - 1 : c + 2].reshape(-1, 3) for r, c in zip(row, column, strict=True)]
        away = [float(np.abs(colours - OUTLINE).sum(axis=1).min()) for colours in near]
        assert (max(away) < 250.0) if there else (min(away) > 250.0)


@pytest.mark.parametrize(("roughness", "over"), [("0.08", 1.5), ("0.16", 2.5)])
def test_a_clipped_highlight_is_told_by_how_much(
    examined: Callable[..., dict[str, Any]], roughness: str, over: float
) -> None:
    """Stops above white within 0.35 of the truth, from what is not clipped; the advice adds what leads to 80 %."""
    changes = {
        "material.parameters.roughness_rad": roughness,
        "material.parameters.diffuse_albedo": "[0.05,0.02,0.02]",
        "noise.read": "2e-4",
    }
    whole = examined({**changes, "image.exposure": "0.1"})
    peak = 10.0 * max(whole["exposure"]["peak"])
    assert whole["exposure"]["lost_stops"] is None
    told = examined({**changes, "image.exposure": str(2.0**over / peak)})
    assert told["exposure"]["lost_stops"] == pytest.approx(over, abs=0.35)
    assert not told["exposure"]["lost_at_least"]
    (advice,) = _advised(told, "stops less")
    stops = float(re.search(r"Expose ([\d.]+) stops less", advice["do"])[1])  # type: ignore[index]  # it is there
    assert stops == pytest.approx(over + 0.32, abs=0.4)
    assert advice["serious"]
    assert told["advice"][0] == advice


def test_a_clipped_body_is_told_as_a_lower_bound(examined: Callable[..., dict[str, Any]]) -> None:
    """Where half the ball is clipped the highlight is unseen: at least, and no more than the truth."""
    told = examined({"image.exposure": "16"})
    assert told["exposure"]["lost_at_least"]
    assert 0.3 < told["exposure"]["lost_stops"] < np.log2(16 * PEAK) + 0.1
    assert "at least" in told["advice"][0]["do"]


def test_an_underexposed_photograph_is_told_by_how_much(examined: Callable[..., dict[str, Any]]) -> None:
    """By three stops: the advice is to expose three more, and with the shutter's time."""
    told = examined({"image.exposure": "0.125"})
    (advice,) = _advised(told, "stops more")
    stops = float(re.search(r"Expose ([\d.]+) stops more", advice["do"])[1])  # type: ignore[index]  # it is there
    assert stops == pytest.approx(3.0, abs=0.15)
    assert "in place of 1/60 s" in advice["do"]


def test_a_light_with_its_axes_mixed_up_is_seen_through(examined: Callable[..., dict[str, Any]]) -> None:
    """With x to the left instead of right, where a fit stops, and with a direction that is wrong by ten degrees."""
    told = examined({}, "--light=0.3687,0.4394,0.8192", code=3)
    (advice,) = _advised(told, "Check the light's axes")
    assert "-0.369,0.439,0.819" in advice["do"]
    assert advice["serious"]
    told = examined({}, "--light=-0.2,0.4394,0.8192")
    assert _advised(told, "Check the light's direction")
    assert told["light"]["instead"] is None
    assert told["light"]["apart_deg"] == pytest.approx(9.0, abs=2.0)


def test_without_a_light_it_is_read_off_the_ball_and_so_told(run: Run) -> None:
    """Within its stated sd; the flag; the advice to measure it."""
    Path("ball.dng.toml").unlink()
    code, out, _ = run("doctor", "ball.dng", "--sphere=275.3,246.8,205", "--no-report", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["flags"] == ["light_estimated"]
    assert told["light"]["source"] == "estimated"
    cosine = float(np.dot(told["light"]["direction"], (-0.3687, 0.4394, 0.8192)))
    assert np.degrees(np.arccos(min(cosine, 1.0))) < told["light"]["sd_deg"]
    assert _advised(told, "fit-material light")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"image.background": "[0.3,0.3,0.3]"}, "black cloth"),
        ({"image.pedestal": "[0.05,0.05,0.05]"}, "Darken the room"),
        ({"sphere.radius_px": "80"}, "Make the ball larger"),
        ({"sphere.centre_px": "[275.0,170.0]"}, "whole ball"),
        ({"image.exposure": "0.02", "noise.read": "2e-3"}, "Give more light"),
    ],
    ids=["background", "stray light", "small", "cut", "noise"],
)
def test_each_fault_is_named(examined: Callable[..., dict[str, Any]], changes: dict[str, str], words: str) -> None:
    """One photograph, one fault, its advice; the good photograph above has none of them."""
    assert _advised(examined(changes, code=3 if words == "whole ball" else 0), words)


def test_where_no_ball_is_found_the_rest_is_told(run: Run) -> None:
    """Exit 3 with one line on stderr; exposure of the frame, noise, the picture, and what to do next."""
    import cv2

    rng = np.random.default_rng(3)
    flat = 20000 + 60 * rng.standard_normal((300, 400, 3))
    cv2.imwrite("wall.png", np.round(flat).astype(np.uint16))
    code, out, err = run("doctor", "wall.png", "--json")
    told = json.loads(out)
    assert code == 3
    assert err == f"fit-material: wall.png: {told['error']}\n"
    assert told["status"] == "failed"
    assert told["exposure"]["of"] == "frame"
    assert told["exposure"]["body"] == pytest.approx([20000 / 65535] * 3, rel=1e-3)
    assert told["sphere"] is None
    assert _advised(told, "--sphere CX,CY,R")
    assert Path("wall.doctor/wall.doctor.png").stat().st_size > 1000
    assert "no ball was found in it" in Path("wall.doctor/wall.doctor.html").read_text()


@pytest.mark.parametrize(("level", "words"), [(150, "check lamp and lens cap"), (65535, "Expose much less")])
def test_a_black_or_blown_frame_is_told_so(run: Run, level: int, words: str) -> None:
    """Rather than asked for the outline of what nobody sees."""
    import cv2

    frame = np.full((120, 160, 3), level, np.uint16)
    frame[::7, ::5] -= 20
    cv2.imwrite("frame.png", frame)
    code, out, _ = run("doctor", "frame.png", "--no-report", "--json")
    (advice,) = [one for one in json.loads(out)["advice"] if one["serious"]]
    assert code == 3
    assert words in advice["do"]


def test_a_small_highlight_is_the_peak_and_a_hot_pixel_is_not() -> None:
    """One pixel bright in all channels counts; one channel's sample that stands alone does not."""
    from toolkit.records import LinearImage, Noise, Plane

    noise = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1e-3), source="given")
    values = np.full((3, 40, 40), 0.05, np.float32)
    values[1, 10, 10] = 0.95  # hot
    for highlight, peak in ((0.05, 0.05), (0.6, 0.6)):
        values[:, 30, 20] = highlight
        planes = tuple(
            Plane(channel=c, values=values[c].copy(), flags=np.zeros((40, 40), np.uint8), origin_px=(0, 0), step_px=1)
            for c in range(3)
        )
        image = LinearImage(name="", sha256="", width_px=40, height_px=40, planes=planes, noise=noise, white=1.0)
        np.testing.assert_allclose(exposure_of(image, None, None).peak, peak, rtol=1e-6)


def test_an_encoded_file_is_told_what_it_lacks(run: Run) -> None:
    """8-bit without --transfer: exit 2 as of a fit, the file's facts, the advice; no picture, but a page."""
    import cv2

    cv2.imwrite("snap.png", np.indices((64, 64, 3)).sum(axis=0).astype(np.uint8))
    code, out, err = run("doctor", "snap.png")
    assert code == 2
    assert "uint8 png" in out
    assert "camera's raw format" in out
    assert len(err.splitlines()) == 1
    assert sorted(path.suffix for path in Path("snap.doctor").iterdir()) == [".html", ".json"]


@pytest.mark.parametrize("words", [("missing.dng",), ("scene.toml",), (".",)])
def test_what_cannot_be_read_leaves_nothing_behind(run: Run, words: tuple[str, ...]) -> None:
    """Exit 3, one line, no folder."""
    code, out, err = run("doctor", *words)
    assert (code, out) == (3, "")
    assert len(err.splitlines()) == 1
    assert not list(Path().glob("*.doctor"))


def test_nothing_is_overwritten_unasked(run: Run) -> None:
    """Exit 2 before anything is read; --overwrite replaces, and the same input gives the same bytes."""
    assert run("doctor", "ball.dng", "-q") == (0, "", "")
    before = {path.name: path.read_bytes() for path in Path("ball.doctor").iterdir()}
    code, out, err = run("doctor", "ball.dng")
    assert (code, out) == (2, "")
    assert "--overwrite" in err
    assert run("doctor", "ball.dng", "-q", "--overwrite") == (0, "", "")
    assert {path.name: path.read_bytes() for path in Path("ball.doctor").iterdir()} == before
    Path("file").write_text("mine")
    assert run("doctor", "ball.dng", "--out", "file")[0] == 2
    assert Path("file").read_text() == "mine"


def test_names_from_outside_are_text_on_the_page(run: Run) -> None:
    """A file named like markup is shown, not obeyed."""
    name = "<img src=x onerror=alert(1)>.dng"
    Path(name).write_bytes(Path("ball.dng").read_bytes())
    assert run("doctor", name, "--sphere=275.3,246.8,205", "--light=-0.3687,0.4394,0.8192", "--out", "o", "-q")[0] == 0
    (page,) = Path("o").glob("*.html")
    assert "<img src=x" not in page.read_text()
    assert "&lt;img src=x" in page.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("index", [3, 22, 47])
def test_a_real_ball_is_examined(run: Run, index: int) -> None:
    """Its clipped highlight is told with a height, its light to 1.5 degrees, and the highlight seen where it is."""
    place = folder("diligent_ball")
    name = (place / "filenames.txt").read_text().split()[index]
    code, out, _ = run("doctor", str(place / name), "--no-report", "--json")
    told = json.loads(out)
    truth = np.loadtxt(place / "light_directions.txt")[index]
    assert code == 0
    assert 0.0 < told["exposure"]["lost_stops"] < 5.0
    assert np.degrees(np.arccos(np.dot(told["light"]["direction"], truth / np.linalg.norm(truth)))) < 2.0
    assert told["light"]["apart_deg"] < told["light"]["tolerance_deg"]
    assert _advised(told, "stops less")
    assert _advised(told, "Make the ball larger")


def test_a_chart_is_no_ball(run: Run) -> None:
    """A camera's raw without a ball: exit 3, and what was read all the same."""
    code, out, _ = run("doctor", str(folder("raw") / "colorchart.dng"), "--no-report", "--json")
    told = json.loads(out)
    assert code == 3
    assert (told["image"]["mosaic"], told["image"]["format"], told["sphere"]) == (True, "raw", None)
    assert told["noise"]["source"] == "estimated"
    assert _advised(told, "--sphere CX,CY,R")
