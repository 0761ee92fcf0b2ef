"""A thousand photographs leave the parent's memory flat; the page sorts and filters."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.browser.devtools import tab

from . import fake, shoots
from .conftest import planned

ROOT = Path(__file__).resolve().parents[2]
ORDER = "Array.from(document.querySelectorAll('#all tbody tr'), r => Number(r.cells[4].dataset.v))"


def many(folder: Path, count: int) -> float:
    """Run a batch of `count` photographs into `folder`/out; the parent's peak memory, MiB."""
    source = shoots.shoot(folder / "shoot", count, bad=(3,))
    run = subprocess.run(
        [sys.executable, "-m", "tests.batch.many", str(source), str(folder / "out")],
        cwd=ROOT,
        env={**os.environ, fake.PLAN: str(folder / "plan")},
        capture_output=True,
        text=True,
        check=True,
    )
    return float(run.stdout)


@pytest.mark.slow
def test_a_thousand_photographs(tmp_path: Path) -> None:
    """The parent takes at most 300 MiB, and no more than 60 MiB beyond what it takes for 100 photographs."""
    peaks = []
    for count in (100, 1000):
        with planned(tmp_path / f"{count}" / "plan"):
            peaks.append(many(tmp_path / str(count), count))
    assert peaks[1] <= 300, peaks
    assert peaks[1] - peaks[0] <= 60, peaks


def test_the_table_sorts_and_filters(tmp_path: Path, plan: Path) -> None:
    """Up, then down, what has no number last; a search, a choice and a tick leave the rows that match."""
    source, out = shoots.shoot(tmp_path / "shoot", 24, bad=(3, 4)), tmp_path / "out"
    shoots.run(source, out)
    with tab(out / "batch.html", tmp_path) as page:
        page.evaluate("document.querySelectorAll('#all thead button')[3].click()")
        up = page.evaluate(ORDER)
        assert up[:22] == sorted(up[:22])
        assert up[22:] == [0, 0]
        page.evaluate("document.querySelectorAll('#all thead button')[3].click()")
        down = page.evaluate(ORDER)
        assert down[:22] == sorted(down[:22], reverse=True)
        assert down[22:] == [0, 0]
        assert page.evaluate("document.querySelector('[aria-sort]').textContent.trim()") == "highlight width"
        for control, value, count in (("text", "BALL01", 10), ("status", "failed", 2), ("flags", "clipped", 22)):
            shown = page.evaluate(
                f"""(() => {{
                const one = document.querySelector('[data-filter={control}]');
                one.value = '{value}'; one.dispatchEvent(new Event('input'));
                const seen = document.querySelectorAll('#all tbody tr:not([hidden])').length;
                const told = document.getElementById('shown').textContent;
                one.value = ''; one.dispatchEvent(new Event('input'));
                return [seen, told];
                }})()"""
            )
            assert shown == [count, f"{count} of 24 shown"]
        page.evaluate("document.querySelector('.plot a').dispatchEvent(new Event('click', {bubbles: true}))")
        assert page.told == []


def test_the_page_reads_without_its_script(tmp_path: Path, plan: Path) -> None:
    """Every number stands in the document itself; the controls are hidden until the script lives."""
    out = tmp_path / "out"
    shoots.run(shoots.shoot(tmp_path / "shoot", 4), out)
    text = (out / "batch.html").read_text(encoding="utf-8")
    assert text.count('<tr role="row" id=') == 4
    assert text.count("data:image/webp") == 4
    assert "html:not(.live) .filters { display: none; }" in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "https://" not in text
