"""--resume of one fit: whether a result is of these very files."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.cli.resume import finished
from pipelines.report.write import write_outputs
from pipelines.settings import ColourTable, ReferenceTable, Settings
from tests.pipelines import fakes
from toolkit.errors import UsageError
from toolkit.records import CameraColour, Reference

FILES = {"ball.dng": "another image", "card.dng": "another grey card", "chart.dng": "another colour chart"}


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def asked(tmp_path: Path) -> list[tuple[Path, Settings]]:
    """A photograph with a card and a chart of their own, and its finished result in ./out."""
    for name in FILES:
        (tmp_path / name).write_bytes(name.encode())
    box = (0, 0, 9, 9)
    settings = Settings(
        reference=ReferenceTable(grey=(0.18, 0.18, 0.18), box_px=box, file="card.dng"),
        colour=ColourTable(chart="chart.dng"),
    )
    card = Reference(
        grey=np.full(3, 0.18),
        box_px=box,
        file="card.dng",
        sha256=sha256(tmp_path / "card.dng"),
        normal=(0.0, 0.0, 1.0),
        radiance=np.ones(3),
        irradiance=np.ones(3),
        irradiance_sd=np.ones(3),
    )
    report = fakes.report(width_px=96, height_px=72, draws=20)
    report = replace(
        report,
        image=replace(report.image, name="ball.dng", sha256=sha256(tmp_path / "ball.dng")),
        reference=card,
        colour=CameraColour(to_srgb=np.eye(3), source="chart", chart_sha256=sha256(tmp_path / "chart.dng")),
    )
    write_outputs(report, tmp_path / "out", settings, page=False)
    return [(tmp_path / "ball.dng", settings)]


@pytest.mark.parametrize("name", FILES)
def test_a_result_is_of_its_photograph_its_card_and_its_chart(asked: list[tuple[Path, Settings]], name: str) -> None:
    """One of them changed is refused in its own words; put back, the result is found again."""
    ((image, _),) = asked
    out, path = image.parent / "out", image.parent / name
    assert finished(asked, out) is not None
    path.write_bytes(b"another")
    with pytest.raises(UsageError, match=f"holds a result of {FILES[name]}; expected --overwrite"):
        finished(asked, out)
    path.write_bytes(name.encode())
    assert finished(asked, out) is not None
