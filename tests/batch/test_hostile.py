"""Names, EXIF strings and material names that want to break out stay text: on the page, in the tables, on the disk."""

from __future__ import annotations

import csv
import json
import os
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from pipelines.batch.photograph import Photograph
from pipelines.batch.plan import Options
from pipelines.batch.tables import FORMULA
from pipelines.batch.whole import batch
from pipelines.report.text import clean
from pipelines.settings import Settings
from tests.browser.devtools import tab

from . import fake, shoots
from .conftest import planned
from .hostile import NAMES


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of sixty photographs, hostile in name, EXIF and material, every tenth failing with hostile words; ten
    more repeat a material, so that it is pooled.
    """
    tmp_path = tmp_path_factory.mktemp("hostile")
    source = tmp_path / "shoot" / "<b>=day"
    source.mkdir(parents=True)
    shown = []
    for number, name in enumerate((*NAMES, *(f"again {name}" for name in NAMES[::6]))):
        path = source / f"{name[:90].replace('/', chr(92))}.dng"
        path.write_bytes(os.fsencode(f"bad hostile {name}" if number % 10 == 9 and number < 60 else name))
        material = NAMES[(number + 1) % 60] if number < 60 else NAMES[(6 * (number - 60) + 1) % 60]
        shown.append(Photograph(path=path, under=(source.name, path.name), material=material))
    place = tmp_path / "out"
    options = Options(out=place, settings_for=lambda one: Settings(), page=False, version="1", parquet=True)
    with planned(tmp_path / "plan"):
        ending = batch(shown, options, shoots.INLINE, ended=lambda item, outcome: None, note=print, work=fake.work)
    assert ending.counts == {"done": 64, "failed": 6}
    return place


def test_nothing_of_it_lives(out: Path, tmp_path: Path) -> None:
    """In Chromium: no script but the page's own, no message, no request, no dialog; every link leads to a file."""
    with tab(out / "batch.html", tmp_path) as page:
        assert page.evaluate("typeof window.broken") == "undefined"
        page.evaluate("document.querySelectorAll('*').forEach(e => { e.dispatchEvent(new Event('mouseover')); })")
        page.evaluate("document.querySelectorAll('thead button').forEach(b => { b.click(); b.click(); })")
        page.evaluate("document.querySelectorAll('.filters select').forEach(s => { s.selectedIndex = 1; })")
        assert page.evaluate("typeof window.broken") == "undefined"
        assert page.evaluate("document.scripts.length") == 1
        assert page.evaluate("document.querySelectorAll('#all tbody tr').length") == 70
        assert page.evaluate("document.querySelectorAll('.material').length") == len(set(map(clean, NAMES)))
        assert page.evaluate("document.querySelectorAll('.strips svg').length") >= 10
        assert page.evaluate("document.querySelectorAll('iframe, object, embed, base, form[action]').length") == 0
        assert page.evaluate("document.documentElement.classList.contains('live')")
        links = page.evaluate("Array.from(document.querySelectorAll('a[href]'), a => a.getAttribute('href'))")
        assert page.told == []
        assert [url for url in page.requests if not url.startswith(("data:", (out / "batch.html").as_uri()))] == []
    for link in links:
        assert link.startswith("#") or (out / unquote(link)).is_file(), link


def test_no_cell_is_a_formula_and_every_table_reads_back(out: Path) -> None:
    """However a spreadsheet splits the lines."""
    for name in ("batch.csv", "batch.materials.csv", "batch.columns.csv"):
        with (out / name).open(encoding="utf-8", newline="") as stream:
            table = list(csv.reader(stream))
        assert len({len(row) for row in table}) == 1
        for cell in (cell for row in table for cell in row):
            assert not alive(cell), cell
            assert cell.isprintable() or "\ufffd" in cell
        for separators in (",", ";", "\t", ",;\t|"):
            for piece in re.split(f"[{separators}\r\n]", (out / name).read_text(encoding="utf-8")):
                assert not alive(piece), (separators, piece)
    told: dict[str, Any] = json.loads((out / "batch.json").read_bytes())
    assert len(told["photographs"]) == 70


def alive(cell: str) -> bool:
    """Whether a spreadsheet would take it for a formula."""
    return cell.lstrip(' \t"').startswith(tuple(FORMULA)) and not is_number(cell)


def is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_no_path_leaves_the_folder_and_none_is_misread(out: Path) -> None:
    """Every file is below it, under a name that all systems take as it is; two photographs, two places."""
    home = out.resolve()
    results = sorted(path.parent for path in out.rglob("*.card.json"))
    assert len(results) == 64
    assert len({str(path).casefold() for path in results}) == 64
    for path in out.rglob("*"):
        assert path.resolve().is_relative_to(home)
        assert len(os.fsencode(path.name)) <= 255
        assert path.name.isprintable()
        assert not set(path.name) & set('<>:"|?*\\')
        assert not path.name.startswith(("-", " "))
        assert not path.name.endswith((" ", "."))


def test_a_page_that_breaks_is_seen(tmp_path: Path) -> None:
    """The control: a script, a message and a request are all noticed."""
    bad = tmp_path / "bad.html"
    bad.write_text('<img src="http://127.0.0.1:9/x.png"><script>window.broken=1; console.error("trouble")</script>')
    with tab(bad, tmp_path) as page:
        assert page.evaluate("window.broken") == 1
        assert page.told
        assert any("127.0.0.1" in url for url in page.requests)
