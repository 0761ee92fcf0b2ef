"""A real series: 48 photographs of one glossy ball, each under its own light, as one material, by one command."""

from __future__ import annotations

import csv
import json
import time
from pathlib import Path

import numpy as np
import pytest

from pipelines.cli import main
from tests.realdata import folder

BALL = "sphere = {centre_px = [307.87, 263.87], radius_px = 70.75, centre_sd_px = 0.3, radius_sd_px = 0.3}"


def manifest(path: Path, count: int) -> Path:
    """The first `count` photographs with their calibrated lights."""
    source = folder("diligent_ball")
    names = (source / "filenames.txt").read_text().split()
    directions = np.loadtxt(source / "light_directions.txt").tolist()
    strengths = np.loadtxt(source / "light_intensities.txt").tolist()
    with path.open("w") as stream:
        for name, direction, irradiance in list(zip(names, directions, strengths, strict=True))[:count]:
            stream.write(
                f'[[photograph]]\nimage = "{source / name}"\nmaterial = "glossy ball"\n[photograph.settings]\n{BALL}\n'
                'camera = {projection = "orthographic"}\n'
                f'light = [{{kind = "directional", direction = {direction}, direction_sd_deg = 1.0, '
                f"irradiance = {irradiance}}}]\n"
            )
    return path


@pytest.mark.slow
def test_forty_eight_photographs_as_one_material(tmp_path: Path) -> None:
    """One command, one page; the highlight's width pooled, with its scatter between photographs and that one's error;
    no photograph without a result, most of them settled; under 4 s of a core a photograph at the preset `quick`.
    """
    out = tmp_path / "fits"
    begin = time.process_time()
    code = main(["batch", str(manifest(tmp_path / "ball.toml", 48)), "--preset", "quick", "--out", str(out), "-q"])
    assert code in (0, 4)
    assert time.process_time() - begin < 60  # the parent's own work
    told = json.loads((out / "batch.json").read_bytes())
    assert told["done"] >= 44
    journal = [json.loads(line) for line in (out / "batch.journal.jsonl").read_text().splitlines()[1:]]
    assert len(journal) == 48
    with (out / "batch.materials.csv").open(encoding="utf-8", newline="") as stream:
        rows = {(row["parameter"], row["channel"]): row for row in csv.DictReader(stream)}
    width = next(row for (name, _), row in rows.items() if name in ("alpha", "roughness_rad", "shininess"))
    assert int(width["count"]) >= 40
    scatter, low, high = (float(width[name]) for name in ("scatter", "scatter_low95", "scatter_high95"))
    assert 0 < low < scatter < high
    assert float(width["scatter_sd"]) < scatter
    assert scatter / float(width["mean"]) < 0.5
    assert "one.headline" not in (out / "batch.html").read_text(encoding="utf-8")
    assert (out / "batch.html").read_text(encoding="utf-8").count("data:image/webp") == 48
