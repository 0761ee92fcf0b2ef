"""`fit-material render`: from a scene file to a photograph of known truth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipelines.layers import read_settings, sidecar_of
from tests.command import Run, runs

SCENE = """
[image]
width_px = 64
height_px = 48
[sphere]
centre_px = [31.0, 24.0]
radius_px = 18.0
[[light]]
kind = "directional"
direction = [0.3, 0.2, 0.93]
irradiance = [2.0, 3.0, 2.5]
[noise]
gain = 1e-4
read = 1e-3
[material]
model = "ggx:masking=v-groove"
[material.parameters]
alpha = 0.2
specular_f0 = 0.04
diffuse_albedo = [0.6, 0.3, 0.1]
"""


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Run the command line in a folder with a scene file."""
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(SCENE)
    return runs(capsys)


def test_render_writes_a_photograph_its_scene_file_and_the_truth(run: Run) -> None:
    """The DNG reads back; the scene file beside it is the sidecar of a fit; the truth is printed."""
    from toolkit.io.read import read

    code, out, err = run("render", "scene.toml", "--out", "ball.dng", "--json")
    assert (code, err) == (0, "")
    truth = json.loads(out)
    assert (truth["model"], truth["variant"]["masking"]) == ("ggx", "v-groove")
    assert truth["parameters"]["alpha"] == 0.2
    assert read(Path("ball.dng")).values.shape == (48, 64)
    beside = sidecar_of(Path("ball.dng"))
    assert beside is not None
    known = read_settings(beside)
    assert known.sphere is not None
    assert (known.sphere.centre_px, known.sphere.radius_px) == ((31.0, 24.0), 18.0)
    np.testing.assert_allclose(known.light[0].irradiance, np.multiply([2.0, 3.0, 2.5], truth["exposure"]))


@pytest.mark.parametrize("suffix", ["dng", "exr", "png"])
def test_the_name_tells_the_format_and_the_seed_the_bytes(run: Run, suffix: str) -> None:
    """Same seed, same bytes; another seed, other bytes."""
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert run("render", "scene.toml", "--out", f"{name}.{suffix}", "--seed", seed)[0] == 0
    a, b, c = (Path(f"{name}.{suffix}").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_the_words_for_people_name_the_truth(run: Run) -> None:
    """Model, parameters, exposure."""
    code, out, _ = run("render", "scene.toml", "--out", "ball.dng", "--set", "image.exposure=0.2")
    assert code == 0
    assert out.startswith("ball.dng: ggx over lambert, masking v-groove; scene file ball.dng.toml\n")
    assert "exposure                0.2\n" in out


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        (["scene.toml", "--out", "ball.jpg"], 2, "--out: ball.jpg ends in '.jpg'; expected .dng, .exr or .png"),
        (["scene.toml", "--out", "none/ball.dng"], 2, "does not exist; expected one that does"),
        (["scene.toml", "--out", "scene.toml"], 2, "scene.toml exists; expected a new name, or --overwrite"),
        (["none.toml", "--out", "ball.dng"], 3, "none.toml: cannot be read"),
        (["empty.toml", "--out", "ball.dng"], 3, "the scene lacks [sphere], [[light]], [material], image.width_px"),
        (["scene.toml", "--out", "ball.dng", "--set", "material.parameters.alhpa=1"], 3, "expected alpha"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(run: Run, words: list[str], code: int, line: str) -> None:
    """Nothing half-written."""
    Path("empty.toml").write_text("")
    before = sorted(Path().rglob("*"))
    found, out, err = run("render", *words)
    assert (found, out) == (code, "")
    assert line in err
    assert err.count("\n") == 1
    assert sorted(Path().rglob("*")) == before
