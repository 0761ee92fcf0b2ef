"""A real series: 48 photographs of one glossy ball, each under its own light, as one material, by one command."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from pipelines.cli import main

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
