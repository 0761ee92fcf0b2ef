"""Mistakes and accidents that only a process of its own meets: signals, full disks, closed streams, permissions."""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli import main
from tests.docs.console import ROOT

from .mistakes import SCENE

MAIN = "import sys; from pipelines.cli import main; sys.exit(main())"
QUICK = ("--preset", "quick", "--model", "phong", "--diffuse", "lambert", "--no-report")
PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH = 24, 1, 2  # linux/prctl.h, linux/capability.h


@pytest.fixture(scope="module")
def photograph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small ball with its scene file beside it."""
    made = tmp_path_factory.mktemp("photograph")
    (made / "scene.toml").write_text(SCENE)
    assert main(["render", str(made / "scene.toml"), "--out", str(made / "ball.dng")]) == 0
    return made / "ball.dng"


@pytest.fixture
def folder(photograph: Path, tmp_path: Path) -> Path:
    """A folder with the photograph and its scene file."""
    for path in (photograph, photograph.with_name("ball.dng.toml")):
        shutil.copy(path, tmp_path / path.name)
    return tmp_path


def run(folder: Path, *words: str | bytes, **options: Any) -> subprocess.CompletedProcess[bytes]:
    """Run fit-material in `folder`."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    told = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": environment, "check": False} | options
    return subprocess.run([sys.executable, "-c", MAIN, *words], cwd=folder, **told)


def one_line(text: bytes) -> str:
    assert text.startswith(b"fit-material: "), text
    assert text.count(b"\n") == 1, text
    return text.decode().removeprefix("fit-material: ").rstrip()


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def small_disk(size: str) -> list[str] | None:
    """Words before a command that give it a disk of `size` at ./disk; None where the system lets nobody make one."""
    script = f'mount -t tmpfs -o size={size} none disk && exec "$@"'
    words = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script, "sh"]
    try:
        works = subprocess.run([*words, "true"], capture_output=True, check=False).returncode == 0
    except OSError:
        return None
    return words if works else None


@pytest.mark.parametrize("room", ["16k", "200k"])  # the first large file does not fit, or a later one
def test_a_full_disk_is_one_line_and_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch, room: str) -> None:
    """Exit 1; what lies on the disk is what lay there before."""
    (folder / "disk").mkdir()
    monkeypatch.chdir(folder)
    before = small_disk(room)
    if before is None:
        pytest.skip("needs a file system of its own: unshare and tmpfs")
    look = f'{sys.executable} -c "{MAIN}" ball.dng {" ".join(QUICK)} --out disk/deep/ball.fit; echo $?; find disk'
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([*before, "sh", "-c", look], capture_output=True, env=environment, check=False)
    assert one_line(done.stderr) == (
        "ball.dng: cannot write to disk/deep/ball.fit: no space left on device; "
        "free some space or choose another folder with --out"
    )
    assert set(done.stdout.decode().split()) <= {"1", "disk", "disk/deep"}


def test_a_limit_on_file_sizes_is_one_line_and_leaves_nothing(folder: Path) -> None:
    """What `ulimit -f` cuts off is no result either."""

    def bound() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))

    before = names(folder)
    done = run(folder, "ball.dng", *QUICK, preexec_fn=bound)
    assert done.returncode == 1
    assert "cannot write to ball.fit: file too large" in one_line(done.stderr)
    assert names(folder) == before


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["the process", "its group, as a terminal does"])
@pytest.mark.parametrize("stage", ["locate", "fit"])
def test_an_interrupt_is_130_and_leaves_nothing(folder: Path, send: Callable[[int, int], None], stage: str) -> None:
    """Ctrl-C in the middle of a stage: one line, nothing written, no process left behind."""
    before = names(folder)
    words = ["ball.dng", "-v", "--set", "fit.ess=100000"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", MAIN, *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's job in the background ignores it
    ) as process:
        assert process.stderr is not None
        assert process.stdout is not None
        for line in process.stderr:
            if line == f"ball.dng: {stage}\n".encode():
                break
        time.sleep(0.2)  # into the stage; wherever it lands, the answer is the same
        send(process.pid, signal.SIGINT)
        rest = process.stderr.read().splitlines()
        assert process.stdout.read() == b""
        assert process.wait() == 130
    assert [line for line in rest if not line.startswith(b"ball.dng: ")] == [b"fit-material: interrupted"]
    assert names(folder) == before
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_stops_nothing(folder: Path, closed: str) -> None:
    """The files are the result; what cannot be said is not said."""
    command = f'"$@" {closed}'
    words = [sys.executable, "-c", MAIN, "ball.dng", *QUICK]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["/bin/sh", "-c", command, "sh", *words], cwd=folder, env=environment, capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert (done.stdout == b"") == (">&-" in closed.replace("2>&-", ""))
    assert (folder / "ball.fit" / "ball.json").exists()


def test_a_closed_stream_hides_no_failure(folder: Path) -> None:
    """The exit code is still that of the mistake."""
    words = [sys.executable, "-c", MAIN, "none.dng"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for closed in ("2>&-", ">&- 2>&-"):
        done = subprocess.run(
            ["/bin/sh", "-c", f'"$@" {closed}', "sh", *words], cwd=folder, env=environment, check=False
        )
        assert done.returncode == 3


def test_a_name_that_is_no_unicode_is_fitted(folder: Path) -> None:
    """Bytes that are no UTF-8 are a name like any other; stdout and files stay readable."""
    name = b"b\xe4ll.dng"
    (folder / "ball.dng").rename(folder / os.fsdecode(name))
    (folder / "ball.dng.toml").rename(folder / os.fsdecode(name + b".toml"))
    done = run(folder, name, *QUICK, "--json", "--out", "out")
    assert (done.returncode, done.stderr) == (0, b"")
    assert b'"status": "ok"' in done.stdout
    done.stdout.decode("utf-8")
    assert len(list((folder / "out").glob("*.json"))) == 2


def test_a_name_that_is_no_unicode_can_be_missing(folder: Path) -> None:
    """One line on any terminal."""
    done = run(folder, b"g\xff\xfene\n.dng", "--json")
    assert done.returncode == 3
    assert "does not exist" in one_line(done.stderr)


def without_privileges() -> None:
    """Root may read everything until it drops these two capabilities; other users have none to drop."""
    if os.geteuid() == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
            if libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0) != 0:
                raise OSError(ctypes.get_errno(), "prctl")


@pytest.mark.skipif(sys.platform != "linux", reason="capabilities are Linux's")
def test_what_may_not_be_read_is_said(folder: Path) -> None:
    """A photograph, a folder on the way to it, a scene, a place for results."""
    for name in ("closed.dng", "closed.toml"):
        shutil.copy(folder / "ball.dng", folder / name)
        (folder / name).chmod(0)
    (folder / "shut").mkdir(mode=0)
    for words, code, line in (
        (["closed.dng", "--out", "out"], 3, "cannot be read (Permission denied); check its permissions"),
        (["shut/ball.dng"], 3, "shut/ball.dng cannot be reached: Permission denied; expected an image file"),
        (["ball.dng", "--scene", "closed.toml"], 3, "closed.toml: cannot be read: Permission denied; expected a scene"),
        (["ball.dng", "--out", "shut/x"], 2, "cannot be written to; expected a folder for the results: --out DIR"),
    ):
        done = run(folder, *words, preexec_fn=without_privileges)
        assert (done.returncode, line in one_line(done.stderr)) == (code, True), done.stderr
