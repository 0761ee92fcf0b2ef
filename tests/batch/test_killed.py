"""A batch killed at any moment: nothing torn, nothing lost, nothing done twice but what was in hand, the same bytes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from . import fake, shoots
from .cut import WORKERS

ROOT = Path(__file__).resolve().parents[2]


def killed(tmp_path: Path, plan: Path, *, photographs: int, crew: str, times: int) -> None:
    """Kill a batch `times` times, let it end, and compare with one that nobody touched."""
    source = shoots.shoot(tmp_path / "shoot", photographs, bad=(3,))
    words = [str(source), str(tmp_path / "cut"), crew, str(times), "20261123"]
    run = subprocess.run(
        [sys.executable, "-m", "tests.batch.cut", *words],
        cwd=ROOT,
        env={**os.environ, fake.PLAN: str(plan)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-3000:]
    seen = json.loads(run.stdout.splitlines()[-1])
    assert (seen["torn"], seen["lost"], seen["twice"]) == (0, 0, 0)
    assert seen["killed"] > times / 2, "most attempts ended before they were killed: nothing was tested"
    assert photographs <= seen["begun"] + seen["last"] <= photographs + WORKERS * seen["killed"]
    shoots.run(source, tmp_path / "whole")
    assert shoots.digests(tmp_path / "cut") == shoots.digests(tmp_path / "whole")
    assert not list((tmp_path / "cut").rglob("*.part"))


def test_twenty_random_kills(tmp_path: Path, plan: Path) -> None:
    """Of the whole process group, with the standard library's own pool."""
    killed(tmp_path, plan, photographs=12, crew="forks", times=20)


@pytest.mark.slow
def test_two_hundred_random_kills(tmp_path: Path, plan: Path) -> None:
    """The same, ten times as often."""
    killed(tmp_path, plan, photographs=120, crew="forks", times=200)


@pytest.mark.slow
def test_random_kills_of_loky_and_its_workers(tmp_path: Path, plan: Path) -> None:
    """Twenty, with the executor that is the default; its workers take a second to begin."""
    killed(tmp_path, plan, photographs=12, crew="loky", times=20)


def test_a_control_that_loses_is_seen(tmp_path: Path, plan: Path) -> None:
    """The checks themselves: a torn file, a result that is gone and one that was made again are counted."""
    from .cut import done, torn

    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"
    shoots.run(source, out)
    assert torn(out) == 0
    (out / "batch.json").write_bytes(b'{"half')
    assert torn(out) == 1
    (out / "day1" / "ball000.fit" / "ball000.json").unlink()
    assert sorted(done(out).items()) == [("ball000.dng", False), ("ball001.dng", True)]
