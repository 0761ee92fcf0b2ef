"""--joint from the command line: one result of two photographs, in whole, found again by --resume, refused in words."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipelines.cli import main
from synthetic.materials import material
from synthetic.photograph import render_photograph
from tests.inference.ball import BODY, NOISE, scene_of
from toolkit.io.read import read

SIZE_PX = 200
ASKED = ["--joint", "--model", "ggx:fresnel=dielectric", "--diffuse", "lambert", "--set", "fit.ess=300"]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two DNGs of a ball under a clear coat of index 1.5, lights 20 and 120 degrees off the axis, with sidecars."""
    folder = tmp_path_factory.mktemp("pair")
    glass = material("ggx", {"alpha": 0.15, "diffuse_albedo": BODY, "specular_index": 1.5})
    paths = [folder / "near.dng", folder / "far.dng"]
    for seed, (path, light_deg) in enumerate(zip(paths, (20.0, 120.0), strict=True)):
        scene = scene_of(SIZE_PX, light_deg=light_deg)
        size = {"width_px": SIZE_PX, "height_px": SIZE_PX}
        render_photograph(scene, glass, NOISE, **size, format="dng", exposure=None, seed=seed, path=path)
    return [str(path) for path in paths]


@pytest.fixture(scope="module")
def result(pair: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of their joint fit."""
    out = tmp_path_factory.mktemp("joint") / "both.fit"
    assert main([*pair, *ASKED, "--out", str(out), "--quiet"]) == 0
    return out


def test_one_folder_holds_it_all(result: Path) -> None:
    """One result under the first image's name; layers and settings of the second are numbered; the page names both."""
    names = {path.name for path in result.iterdir()}
    assert names == {
        *(f"near{s}" for s in (".json", ".run.json", ".html", ".posterior.nc", ".layers.exr", ".settings.toml")),
        "near.layers-2.exr",
        "near.settings-2.toml",
    }
    assert "far.dng" in (result / "near.html").read_text(encoding="utf-8")
    first, second = (read(result / f"near.layers{number}.exr").values.shape for number in ("", "-2"))
    assert first == second


def test_the_object_tells_of_each_photograph(result: Path) -> None:
    """`photographs` holds both scenes; F0 is that of index 1.5, as neither photograph alone can tell so well."""
    found = json.loads((result / "near.json").read_text(encoding="utf-8"))
    assert [one["image"]["name"] for one in found["photographs"]] == ["near.dng", "far.dng"]
    assert found["photographs"][0]["lights"] == found["lights"]
    far = found["photographs"][1]["lights"][0]
    assert far["direction"][2] == pytest.approx(-0.5)
    assert np.dot(far["fitted"]["direction"], far["direction"]) > np.cos(np.radians(1.0))
    parameters = found["fits"][0]["parameters"]
    assert found["fits"][0]["variant"] == {"masking": "smith", "fresnel": "dielectric"}
    assert parameters["specular_f0"]["estimate"] == pytest.approx([0.04] * 3, rel=0.01)
    assert "pedestal_2" in parameters


def test_resume_knows_both_images(pair: list[str], result: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The very same pair is kept; in the other order, or with other settings, it is another result."""
    again = [*ASKED, "--out", str(result), "--resume", "--json"]
    assert main([*pair, *again]) == 0
    assert capsys.readouterr().out == (result / "near.json").read_text(encoding="utf-8")
    assert main([*pair, *again, "--seed", "1"]) == 2
    assert "other settings" in capsys.readouterr().err
    other = Path(pair[1]).with_name("other.dng")
    other.write_bytes(Path(pair[1]).read_bytes() + b"\0")
    Path(f"{other}.toml").write_bytes(Path(f"{pair[1]}.toml").read_bytes())
    assert main([pair[0], str(other), *again]) == 2
    assert "another image" in capsys.readouterr().err


def test_what_is_fitted_must_agree(pair: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A sidecar that asks for another fit than the first image's is named."""
    told = Path(f"{pair[1]}.toml")
    before = told.read_text(encoding="utf-8")
    told.write_text(before + "\n[fit]\nfix = ['light']\n", encoding="utf-8")
    try:
        assert main([*pair, *ASKED, "--out", str(tmp_path / "x")]) == 2
    finally:
        told.write_text(before, encoding="utf-8")
    assert "far.dng differs" in capsys.readouterr().err
