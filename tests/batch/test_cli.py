"""`fit-material batch` on the command line: what it prints, where, and the exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipelines.cli.progress import duration
from tests.command import Run, runs

from . import fake, shoots


@pytest.fixture
def run(plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """The command line in a folder with photographs, work done in this process with the fit faked."""
    monkeypatch.setattr("pipelines.batch.crew.loky_processes", shoots.inline)
    monkeypatch.setattr("pipelines.batch.whole.batch.__kwdefaults__", {"work": fake.work})
    monkeypatch.chdir(tmp_path)
    shoots.shoot(tmp_path / "shoot", 4, bad=(2,))
    return runs(capsys, "batch")


def test_a_summary_on_stderr_and_exit_code_4_where_some_failed(run: Run) -> None:
    """Each failure in one line, then how many; nothing on stdout."""
    code, out, err = run("shoot", "--out", "fits")
    assert (code, out) == (4, "")
    assert err.splitlines() == [
        "fit-material: day1/ball002.dng: found a bad photograph; expected a good one",
        "3 of 4 photographs done, 1 failed; page: fits/batch.html",
    ]
    code, out, err = run("shoot", "--out", "fits", "--resume", "-q")
    assert (code, err.count("\n")) == (4, 1)


def test_jsonl_prints_each_result_as_it_ends(run: Run) -> None:
    """The object of its STEM.json, or of the failure; -v tells of each with the time to go on stderr."""
    code, out, err = run("shoot/day1", "shoot/day2/ball001.dng", "--out", "fits", "--jsonl", "-v")
    assert code == 4
    told = [json.loads(line) for line in out.splitlines()]
    assert sorted((one["image"]["name"], one["status"]) for one in told) == [
        ("ball000.dng", "ok"),
        ("ball001.dng", "ok"),
        ("ball002.dng", "failed"),
    ]
    assert ["found a bad photograph" in one["error"] for one in told if one["error"]] == [True]
    assert "/3] ball000.dng: done, about" in err


def test_exit_codes_are_those_of_several_images(run: Run) -> None:
    """0 where all are done, 3 where all are bad input, 2 for usage."""
    assert run("shoot/day2", "--out", "good")[0] == 0
    assert run("shoot/day1/ball002.dng", "--out", "bad")[0] == 3
    assert run("missing.dng", "--out", "none")[0] == 3
    for words, told in {
        ("--out", "x"): "found no photograph",
        ("shoot",): "--out",
        ("shoot", "--out", "good"): "holds a batch",
        ("shoot", "--out", "x", "--resume", "--overwrite"): "contradict",
        ("shoot", "--out", "x", "--jobs", "0"): "--jobs",
        ("shoot", "--out", "x", "--executor", "ray"): "--executor",
        ("shoot", "--out", "x", "--export", "nope"): "nope",
        ("shoot", "--out", "x", "--set", "fit.nope=1"): "--set",
        ("shoot", "--out", "shoot/day1/ball000.dng"): "is a file",
    }.items():
        code, out, err = run(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), words
        assert told in err
        assert not Path("x").exists()


def test_settings_come_in_layers_and_a_wrong_file_fails_its_photograph_only(run: Run) -> None:
    """Sidecar < --scene < manifest < flags; each photograph's complete settings lie beside its result."""
    Path("shoot/day1/ball000.dng.toml").write_text("[sphere]\ncentre_px = [1, 2]\nradius_px = 10\n")
    Path("shoot/day2/ball003.dng.toml").write_text("[sphere]\nradius = 3\n")
    Path("rig.toml").write_text("[fit]\nseed = 5\ness = 500\n")
    Path("m.csv").write_text(
        'image,sphere\nshoot/day1/ball000.dng,"3,4,20"\nshoot/day2/ball001.dng,\nshoot/day2/ball003.dng,\n'
    )
    code, _, err = run("m.csv", "--scene", "rig.toml", "--seed", "7", "--out", "fits")
    assert code == 4
    assert "ball003.dng.toml" in err
    written = Path("fits/shoot/day1/ball000.fit/ball000.settings.toml").read_text()
    assert "radius_px = 20.0" in written
    assert "seed = 7" in written
    assert "ess = 500" in written
    assert not Path("fits/shoot/day2/ball003.fit").exists()


def test_a_dry_run_lists_photographs_and_places(run: Run) -> None:
    """And writes nothing."""
    code, out, err = run("shoot", "--out", "fits", "--dry-run")
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "day1/ball000.dng -> day1/ball000.fit"
    assert not Path("fits").exists()


def test_strict_refuses_low_quality(run: Run) -> None:
    """The fake's flag `clipped` is one of those."""
    code, _, err = run("shoot/day2", "--out", "fits", "--strict")
    assert code == 5
    assert "clipped" in err


def test_material_names_those_that_no_manifest_names(run: Run) -> None:
    """Its repeats are pooled."""
    run("shoot", "--out", "fits", "--material", "red paint")
    assert {row["material"] for row in json.loads(Path("fits/batch.json").read_bytes())["materials"]} == {"red paint"}


def test_durations_read_as_people_say_them() -> None:
    """Seconds, minutes, hours."""
    assert [duration(s) for s in (4, 89, 100, 4000, 12000)] == ["4 s", "89 s", "2 min", "67 min", "3 h 20 min"]
