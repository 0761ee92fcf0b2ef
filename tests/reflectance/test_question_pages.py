"""The lecture's questions: what their pages say is what the lobes give now."""

from __future__ import annotations

import runpy
import xml.etree.ElementTree as ET  # our own pictures
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def pages():
    """Texts and pictures made anew."""
    return runpy.run_path(str(DOCS / "make_questions.py"))["pages"]()


def test_pages_say_what_the_lobes_give(pages):
    """Texts and numbers as made now."""
    assert {path.stem for path in (DOCS / "questions").glob("*.md")} == set(pages)
    for name, (text, _) in pages.items():
        assert (DOCS / "questions" / f"{name}.md").read_text(encoding="utf-8") == text, "run: docs/make_questions.py"


def test_every_page_shows_its_picture(pages):
    """An SVG with axes in it, and the page that links it."""
    for name, (text, figure) in pages.items():
        assert f"({name}.svg)" in text
        root = ET.parse(DOCS / "questions" / f"{name}.svg").getroot()  # noqa: S314  # our own pictures
        drawn = [group for group in root.iter() if group.get("id", "").startswith("axes_")]
        assert len(drawn) == len(figure.axes)
