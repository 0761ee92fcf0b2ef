"""The command line as a process of its own: what it imports, pipes, terminals, signals."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipelines.workers import ALONE, side_by_side

from .test_fit_material import ball

__all__ = ["ball"]  # the fixture
HEAVY = {"colour", "matplotlib", "skimage", "cv2", "scipy", "xarray", "emcee", "h5py"}
AVOIDED = HEAVY | {"numpy", "pydantic", "rawpy", "OpenEXR", "tifffile", "PIL", "jinja2", "toolkit.records"}
LONG_S = 60.0
MAIN = "import sys; from pipelines.cli import main; sys.exit(main())"


def command(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run fit-material in its own process."""
    where = {**os.environ, "COLUMNS": "80", **environment}
    return subprocess.run([sys.executable, "-c", MAIN, *words], capture_output=True, text=True, env=where, check=False)


@pytest.mark.parametrize("words", [["--help"], ["render", "--help"], ["--version"], ["--nope"], []])
def test_help_imports_nothing_heavy(words: list[str]) -> None:
    """Help, version and a wrong option answer without numpy or anything heavier."""
    listing = "import sys; from pipelines.cli import main; main(sys.argv[1:]); print('|', *sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", listing, *words], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.rpartition("|")[2].split())
    assert "pipelines.cli.app" in loaded
    assert loaded & AVOIDED == set()


def test_a_reader_who_leaves_is_no_error() -> None:
    """`fit-material models | head -0` ends quietly."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([sys.executable, "-c", MAIN, "models"], stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_stdout_is_a_failure_in_one_line() -> None:
    """No traceback of the interpreter's own at its end either."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-c", MAIN, "models"], stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 1
    assert done.stderr.count(b"\n") == 1
    assert b"No space left" in done.stderr


def test_an_ascii_stdout_gets_ascii(tmp_path: Path) -> None:
    """Where stdout cannot hold a letter it is replaced in text and escaped in JSON."""
    image = tmp_path / "bäll.dng"
    done = command(str(image), "--json", PYTHONIOENCODING="ascii", LC_ALL="C")
    assert done.returncode == 3
    assert done.stdout.isascii()
    assert json.loads(done.stdout)["image"]["name"] == "bäll.dng"


def test_control_characters_in_a_name_reach_no_terminal(tmp_path: Path) -> None:
    """A file's name cannot colour the terminal or add a line."""
    done = command(str(tmp_path / "a\x1b[31m\nb.dng"))
    assert done.returncode == 3
    assert "\x1b" not in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("environment", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_colour_only_on_a_terminal_that_wants_it(environment: dict[str, str], coloured: bool) -> None:
    """Escape codes on a terminal, none of colour under NO_COLOR, none in a pipe."""
    ours, theirs = pty.openpty()
    show = (
        "from pipelines.cli.terminal import Terminal\n"
        "Terminal().show(lambda console: console.print('word', style='red'))"
    )
    clean = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR", "TERM")}
    where = {**clean, "TERM": "xterm-256color", **environment}
    subprocess.run([sys.executable, "-c", show], stdout=theirs, env=where, check=True)
    os.close(theirs)
    assert (b"\x1b[31m" in os.read(ours, 1000)) == coloured
    os.close(ours)
    piped = subprocess.run([sys.executable, "-c", show], capture_output=True, env=where, check=True)
    assert piped.stdout == b"word\n"


def test_progress_only_on_a_terminal() -> None:
    """A pipe on stderr sees no animation."""
    show = (
        "from pipelines.cli.terminal import Terminal\n"
        "with Terminal().progress('ball.dng') as tell: tell('fit', 0.5); tell('fit', 1.0)"
    )
    piped = subprocess.run([sys.executable, "-c", show], capture_output=True, check=True)
    assert (piped.stdout, piped.stderr) == (b"", b"")
    ours, theirs = pty.openpty()
    where = {**os.environ, "TERM": "xterm-256color"}
    subprocess.run([sys.executable, "-c", show], stdout=subprocess.PIPE, stderr=theirs, env=where, check=True)
    os.close(theirs)
    assert b"ball.dng: fit" in os.read(ours, 10_000)
    os.close(ours)


@pytest.mark.skipif(side_by_side(None) < 2, reason="nothing is begun early")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_run_that_is_ended_leaves_no_files(ball: Path, tmp_path: Path, number: signal.Signals, code: int) -> None:
    """Its files are begun while the last fit is out, which takes long here."""
    words = [
        str(ball),
        "--model",
        "torrance-sparrow",
        "--model",
        "phong",
        "--diffuse",
        "lambert",
        "--set",
        "fit.ess=300000",
    ]
    command = [sys.executable, "-c", MAIN, *words, "--out", str(tmp_path / "out")]
    where = {name: value for name, value in os.environ.items() if name != ALONE}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=where) as process:
        until = time.monotonic() + LONG_S
        while not list(tmp_path.glob(".fit-material-*.part")):
            assert process.poll() is None
            assert time.monotonic() < until
            time.sleep(0.005)
        process.send_signal(number)
        _, err = process.communicate(timeout=LONG_S)
    assert process.returncode == code
    assert err.count("\n") <= 1
    assert list(tmp_path.iterdir()) == []
