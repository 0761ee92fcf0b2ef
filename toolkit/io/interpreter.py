"""A fresh Python interpreter for decoders: nothing of this process in it but where to import from."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO, NamedTuple

LAST_WORDS = 4096  # bytes kept of what a child writes to its standard error
_BOOT = "from toolkit.io.child import main; main(sys.argv[2])"
_PASSED_ON = (
    "PATH",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "SYSTEMROOT",
    "TMPDIR",
    "TEMP",
    "LANG",
    "LC_ALL",
    "LC_CTYPE",
)


class Ending(NamedTuple):
    """How a child ended: its exit status, the signal below zero, None where it took too long; its last words."""

    status: int | None
    said: bytes


def run(request: str, answer: IO[bytes], wall_s: float) -> Ending:
    """How a fresh interpreter ended that decoded what child.py is asked for into the file `answer`."""
    with start(_BOOT, request, stdin=subprocess.DEVNULL, stdout=answer, stderr=subprocess.PIPE) as child:
        said = None
        try:
            said = _drain(child, wall_s)
        finally:
            if said is None:  # it took too long, or the user interrupts
                child.kill()
        return Ending(None, b"") if said is None else Ending(child.wait(), said)


def start(
    code: str, *arguments: str, stdin: int, stdout: int | IO[bytes], stderr: int, apart: bool = False
) -> subprocess.Popen[bytes]:
    """An interpreter that runs `code` with `arguments`, from sys.argv[2] on.

    One `apart` keeps no folder busy, and has a session of its own: the terminal's Ctrl-C does not reach it.
    """
    boot = f"import sys, json; sys.path[:] = json.loads(sys.argv[1]); {code}"
    # -S: what `site` would add is in the parent's path already
    command = [sys.executable, "-I", "-S", "-c", boot, json.dumps(_import_path()), *arguments]
    return subprocess.Popen(
        command,
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        env=_environment(),
        cwd="/" if apart else None,
        start_new_session=apart,
    )


def _import_path() -> list[str]:
    """Where the child finds what the parent has imported; never the current folder, which may hold anything."""
    home = str(Path(__file__).resolve().parents[2])
    return [home, *(entry for entry in sys.path if Path(entry).is_absolute())]


def _environment() -> dict[str, str]:
    """What libraries need to load, and no more.

    One thread a library, for start-up and for the memory limit; large blocks of memory in large pages, where the C
    library is glibc: LibRaw's pixels are first touched in a fifth less time.
    """
    kept = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
    ours = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
    return kept | ours


def _drain(child: subprocess.Popen[bytes], wall_s: float) -> bytes | None:
    """The end of what the child wrote to its standard error; None where it did not end in time.

    A thread reads, since waiting for a process with a time limit polls and so wastes up to 50 ms.
    """
    kept = bytearray()

    def read() -> None:
        while chunk := os.read(child.stderr.fileno(), 65_536):  # type: ignore[union-attr]  # stderr is a pipe
            kept.extend(chunk)
            del kept[:-LAST_WORDS]

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    reader.join(wall_s)
    return None if reader.is_alive() else bytes(kept)
