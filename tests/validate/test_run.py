"""Trials side by side, cut short and gone on with: nothing lost, nothing done twice, the same answer."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines.cli import main
from pipelines.validate.design import hypercube
from pipelines.validate.record import NAME, opened
from pipelines.validate.run import KEPT, run
from toolkit.errors import UsageError

ROOT = Path(__file__).parents[2]
SMALL = """
[image]
width_px = 120
height_px = 120
[sphere]
centre_px = [59.5, 59.5]
radius_px = 50
[[light]]
kind = "directional"
direction = [0.3, 0.4, 0.9]
irradiance = [1.0, 1.0, 1.0]
[material]
model = "beckmann"
[material.parameters]
alpha = 0.25
diffuse_albedo = [0.4, 0.3, 0.2]
specular_f0 = 0.05
"""


def test_a_torn_line_is_passed_over_and_another_design_refused(tmp_path: Path) -> None:
    """What a crash cut short counts as not done; a record of other trials is left alone."""
    trials = hypercube(3)
    with opened(tmp_path, trials, resume=False) as record:
        record.add({"number": 0, "status": "done"})
    with (tmp_path / NAME).open("ab") as stream:
        stream.write(b'{"number": 1, "sta')
    with opened(tmp_path, trials, resume=True) as record:
        assert [line["number"] for line in record.before] == [0]
        record.add({"number": 1, "status": "done"})
    with opened(tmp_path, trials, resume=True) as record:
        assert sorted(line["number"] for line in record.before) == [0, 1]
    with pytest.raises(UsageError, match="other trials"), opened(tmp_path, hypercube(4), resume=True):
        pass
    with (
        pytest.raises(UsageError, match="another --discrepancy"),
        opened(tmp_path, trials, resume=True, discrepancy=False),
    ):
        pass


def test_a_finished_trial_is_not_done_again(tmp_path: Path) -> None:
    """All lines come from the record, in their order, and each is told of."""
    trials, told = hypercube(3), list[int]()
    with opened(tmp_path, trials, resume=False) as record:
        for trial in trials:
            record.add({"number": trial.number, "status": "done", "mark": "kept"})
    lines = run(
        trials, tmp_path, workers=1, resume=True, discrepancy=True, ended=lambda line: told.append(line["number"])
    )
    assert [line["mark"] for line in lines] == ["kept"] * 3
    assert told == [0, 1, 2]


def test_killed_in_mid_run_it_goes_on_and_ends_as_if_it_had_not_been(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """SIGKILL after the second trial; --resume keeps both, and the table is that of an unbroken run."""
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(SMALL)
    words = ["validate", "--scene", "small.toml", "--renders", "8", "--jobs", "2"]
    start = "import sys; from pipelines.cli import main; sys.exit(main())"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(
        [sys.executable, "-c", start, *words, "--out", "broken"],
        env=environment,
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    record = Path("broken") / NAME
    while not record.exists() or record.read_bytes().count(b"\n") < 3:
        assert child.poll() is None
        time.sleep(0.02)
    os.killpg(child.pid, signal.SIGKILL)
    child.wait()
    kept = record.read_bytes().splitlines()[1:3]
    assert main([*words, "--out", "broken"]) == 2  # nothing is overwritten unasked
    capsys.readouterr()
    assert main([*words, "--out", "broken", "--resume", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {"renders", "verdict", "coverage", "efficiency", "failures", "seconds"} <= set(told)
    assert all(line in record.read_bytes().splitlines() for line in kept)
    assert len(record.read_bytes().splitlines()) == 1 + 8
    assert main([*words, "--out", "whole"]) == 0
    assert "With this set-up" in capsys.readouterr().out
    assert Path("whole/validation.csv").read_bytes() == Path("broken/validation.csv").read_bytes()


def test_a_run_begun_anew_forgets_what_an_earlier_one_kept(tmp_path: Path) -> None:
    """Photographs of earlier failures go; without any the folder goes too."""
    (tmp_path / KEPT).mkdir()
    (tmp_path / KEPT / "trial-00007.dng").touch()
    trials = hypercube(1)
    run(trials, tmp_path, workers=1, resume=False, discrepancy=True, ended=lambda _: None)
    assert not (tmp_path / KEPT).exists()


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [
        (["--renders", "9"], "--renders is for --scene", 2),
        (["--resume", "--overwrite"], "contradict", 2),
        (["--jobs", "0"], "--jobs: found 0", 2),
        (["--against", "none.json"], "holds no validation record", 3),
        (["--scene", "bare.toml"], "the scene lacks [material], [sphere], [[light]]", 3),
        (["sometimes"], "Invalid value", 2),
    ],
)
def test_a_mistake_gets_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    said: str,
    code: int,
) -> None:
    """What was found, what was expected; nothing is written."""
    monkeypatch.chdir(tmp_path)
    Path("bare.toml").write_text("")
    assert main(["validate", *words]) == code
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bare.toml"]
