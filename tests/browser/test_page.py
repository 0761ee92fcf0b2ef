"""The page in a real browser: it opens without a complaint, asks for nothing, and shows itself in both schemes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pipelines.report.page import page_text
from pipelines.settings import Settings
from tests.pipelines import fakes

from .chromium import visit


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "ball.html"
    path.write_text(page_text(fakes.hostile_report(), Settings()), encoding="utf-8")
    return path


def test_the_page_opens_without_a_complaint_and_asks_for_nothing(page: Path, tmp_path: Path) -> None:
    """No message on the console, no request on the wire, every picture decoded, no hostile string alive."""
    seen = visit(page, tmp_path, "--dump-dom")
    assert seen.console == ()
    assert seen.requests == ()
    assert "What the light did" in seen.dom
    assert seen.dom.count('src="data:image/png') == 6
    assert "<script" not in seen.dom
    assert "&lt;script&gt;alert" in seen.dom


def test_a_page_that_complains_and_asks_is_caught(tmp_path: Path) -> None:
    """The control: a script's error and a picture from elsewhere both show."""
    bad = tmp_path / "bad.html"
    bad.write_text('<img src="http://example.invalid/x.png"><script>console.error("trouble")</script>')
    seen = visit(bad, tmp_path, "--dump-dom")
    assert any("trouble" in line for line in seen.console)
    assert any("example.invalid" in line for line in seen.requests)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_follows_the_readers_scheme(page: Path, tmp_path: Path, scheme: str) -> None:
    """Paper and ink change places; the pictures are there in both."""
    shot = tmp_path / "shot.png"
    preferred = {"dark": 0, "light": 1}[scheme]
    flags = (f"--screenshot={shot}", "--window-size=1200,1400", f"--blink-settings=preferredColorScheme={preferred}")
    visit(page, tmp_path, *flags)
    pixels = np.asarray(Image.open(shot).convert("RGB")).astype(float) / 255
    paper = pixels[:20, :20].mean()
    assert paper > 0.9 if scheme == "light" else paper < 0.15
    orange = (pixels[..., 0] > 0.5) & (pixels[..., 2] < 0.25) & (pixels[..., 0] > 1.3 * pixels[..., 1])
    assert orange.mean() > 0.03


def test_the_page_prints(page: Path, tmp_path: Path) -> None:
    """As a PDF of a few pages."""
    paper = tmp_path / "page.pdf"
    visit(page, tmp_path, f"--print-to-pdf={paper}", "--no-pdf-header-footer")
    printed = paper.read_bytes()
    assert printed.startswith(b"%PDF")
    assert 4 <= len(re.findall(rb"/Type /Page\b(?!s)", printed)) <= 20
