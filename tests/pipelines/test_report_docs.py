"""docs/report.md says what the page says, and its examples run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pipelines.export import EXPORTERS
from pipelines.report.dictionary import FIELDS, FILES
from pipelines.report.write import OWN, write_outputs
from pipelines.settings import Settings
from tests.pipelines import fakes

DOCUMENT = Path(__file__).parents[2] / "docs" / "report.md"


@pytest.fixture(scope="module")
def text() -> str:
    return DOCUMENT.read_text(encoding="utf-8")


def test_every_file_and_field_is_documented_as_on_the_page(text: str) -> None:
    """One dictionary serves both."""
    assert {suffix for suffix, _ in FILES} == set(OWN)
    for suffix, _ in FILES:
        assert f"| `ball{suffix}` |" in text
    for name, meaning in FIELDS:
        assert f"| `{name}` | {meaning} |" in text


def test_every_exporter_is_documented(text: str) -> None:
    """By name and file."""
    for one in EXPORTERS.values():
        assert f"| `{one.name}` | `ball{one.suffix}` |" in text


def test_the_examples_run(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each block of Python, in the folder of a photograph that was just fitted."""
    write_outputs(fakes.report(), tmp_path / "ball.fit", Settings(), page=False)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        exec(compile(block, str(DOCUMENT), "exec"), {})  # noqa: S102  # our own documentation
