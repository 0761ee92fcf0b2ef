"""Every mistake a user makes gets one line (found, expected, remedy) and its exit code, and leaves nothing behind."""

from __future__ import annotations

import fnmatch
import json
from pathlib import Path

import pytest

from pipelines.cli import main
from tests.docs.console import ROOT

from .mistakes import LIGHT, MISTAKES, SPHERE, Mistake, make_folder

QUICK = ["--preset", "quick", "--model", "phong", "--diffuse", "lambert"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the table's commands name."""
    made = tmp_path_factory.mktemp("mistakes")
    make_folder(made)
    return made


def everything(folder: Path) -> list[tuple[str, int, int]]:
    """Names, sizes and times of all files, the hidden too."""
    found = ((path, path.lstat()) for path in folder.rglob("*"))
    return sorted((str(path), state.st_size, state.st_mtime_ns) for path, state in found)


def matches(line: str, pattern: str) -> bool:
    """Whether a line is as the table says; only `*` is special."""
    return fnmatch.fnmatchcase(line, pattern.replace("[", "[[]").replace("?", "[?]"))


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_is_one_line_and_leaves_nothing(
    folder: Path, mistake: Mistake, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code and line as in the table; no traceback, no result, nothing half-written."""
    monkeypatch.chdir(folder)
    capsys.readouterr()
    before = everything(folder)
    code = main([*mistake.words.split(), *QUICK])
    out, err = capsys.readouterr()
    assert err.startswith("fit-material: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert "unexpected" not in err
    assert matches(err.removeprefix("fit-material: ").rstrip("\n"), mistake.line), err
    assert code == mistake.code
    assert len(err) < 420
    assert (json.loads(out)["status"] == "failed") if "--json" in mistake.words else out == ""
    assert everything(folder) == before


def test_the_same_photograph_without_a_mistake_is_fitted(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table's refusals are of the mistakes: right sphere and light, found or told, in DNG and PNG, give results."""
    monkeypatch.chdir(folder)
    for image, words in (
        ("ball.dng", ["--sphere", SPHERE, f"--light={LIGHT}"]),
        ("ball.dng", []),
        ("ball.png", ["--sphere", SPHERE]),
        ("./batch", ["--sphere", SPHERE, f"--light={LIGHT}"]),
    ):
        out = tmp_path / str(len(list(tmp_path.iterdir())))
        assert main([image, *words, *QUICK, "--no-report", "--out", str(out), "-q"]) == 0, capsys.readouterr().err


def test_the_documented_lines_are_those_of_the_table() -> None:
    """docs/cli.md quotes what is said, `…` for what differs; every mistake it names is tried here."""
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    section = text.partition("## When something is wrong\n")[2].partition("\n## ")[0]
    rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| ")][2:]
    table = {mistake.what: mistake for mistake in MISTAKES}
    assert len(rows) > 10
    for what, line, code in rows:
        tried = table[what.removeprefix("| ")]
        assert matches(line.strip("`").replace("…", "*"), tried.line) or tried.line == line.strip("`").replace("…", "*")
        assert int(code.rstrip(" |")) == tried.code


def test_a_wrong_line_would_be_seen() -> None:
    """The comparison lets `*` differ and nothing else."""
    assert matches("a.dng: 3 px [x]?", "a.dng: * px [x]?")
    assert not matches("a.dng: 3 px [x]!", "a.dng: * px [x]?")
    assert not matches("a.dng: 3 cm x?", "a.dng: * px [x]?")
