"""Real fits: 48 photographs of one glossy ball, each under its own light, as one material; a group fitted jointly."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pipelines.cli import main
from synthetic.materials import material
from synthetic.photograph import render_photograph
from tests.inference.ball import BODY, NOISE, scene_of

from .series import COUNT, manifest


@pytest.mark.slow
def test_forty_eight_photographs_as_one_material(tmp_path: Path) -> None:
    """One command, one page; the highlight's width pooled, with its scatter between photographs and that one's error;
    no photograph without a row and a picture, most of them settled.
    """
    out = tmp_path / "fits"
    assert main(["batch", str(manifest(tmp_path / "ball.toml")), "--preset", "quick", "--out", str(out), "-q"]) in (
        0,
        4,
    )
    told = json.loads((out / "batch.json").read_bytes())
    assert told["count"] == COUNT
    assert told["done"] >= 44
    with (out / "batch.materials.csv").open(encoding="utf-8", newline="") as stream:
        rows = {(row["parameter"], row["channel"]): row for row in csv.DictReader(stream)}
    width = next(row for (name, _), row in rows.items() if name in ("alpha", "roughness_rad", "shininess"))
    assert int(width["count"]) >= 40
    scatter, low, high = (float(width[name]) for name in ("scatter", "scatter_low95", "scatter_high95"))
    assert 0 < low < scatter < high
    assert float(width["scatter_sd"]) < scatter
    assert scatter / float(width["mean"]) < 0.5
    page = (out / "batch.html").read_text(encoding="utf-8")
    assert page.count("data:image/webp") == COUNT
    assert "scatter between photographs" in page


@pytest.mark.slow
def test_a_group_of_a_manifest_is_one_fit(tmp_path: Path) -> None:
    """Two renders of a clear coat of index 1.5 give one row with its F0, which neither could tell alone."""
    glass = material("ggx", {"alpha": 0.15, "diffuse_albedo": BODY, "specular_index": 1.5})
    for seed, (name, light_deg) in enumerate({"near": 20.0, "far": 120.0}.items()):
        size = {"width_px": 200, "height_px": 200}
        scene = scene_of(200, light_deg=light_deg)
        render_photograph(
            scene, glass, NOISE, **size, format="dng", exposure=None, seed=seed, path=tmp_path / f"{name}.dng"
        )
    (tmp_path / "m.csv").write_text("image,group,material\nnear.dng,pair,glass\nfar.dng,pair,glass\nnear.dng,,\n")
    asked = ["--model", "ggx:fresnel=dielectric", "--diffuse", "lambert", "--set", "fit.ess=300"]
    assert main(["batch", str(tmp_path / "m.csv"), *asked, "--out", str(tmp_path / "fits"), "-q"]) == 0
    (row,) = json.loads((tmp_path / "fits" / "batch.json").read_bytes())["photographs"]
    assert (row["photograph"], row["group"], row["place"]) == ("near.dng + far.dng", "pair", "near.fit")
    assert row["specular_f0_g"] == pytest.approx(0.04, rel=0.01)
    assert "pedestal_2_g" not in row
    assert (tmp_path / "fits" / "near.fit" / "near.layers-2.exr").is_file()
