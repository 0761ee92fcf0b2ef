"""Decoding in a child process: a decoder that crashes, hangs or swells takes nothing with it.

The child is a fresh interpreter started through `subprocess`, so it works in daemonic workers and needs no guard in
the user's script. Its standard output is a file in memory that both share: the pixels come back without a copy.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from toolkit.errors import BadInputError
from toolkit.io.decoded import Decoded, Limits
from toolkit.io.metadata import plain_text

_LONGEST_JSON = 1 << 20
_TYPES = {"uint8", "uint16", "float32"}
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
_BOOT = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from toolkit.io.child import main; main(sys.argv[2])"


def decode(kind: str, path: str, limits: Limits) -> Decoded:
    """Decode a file of this kind in a child; its pixels are mapped read-only.

    Raises BadInputError: the decoder's own, or what became of the child.
    """
    with _shared_file() as answer:
        complaint = _run(kind, path, limits, answer)
        if complaint is not None:
            raise BadInputError(complaint)
        return _read_answer(answer)


def _shared_file() -> IO[bytes]:
    """A nameless file, in memory where the system has such files."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("fit-material-pixels"), "w+b")
    return cast("IO[bytes]", tempfile.TemporaryFile())


def _run(kind: str, path: str, limits: Limits, answer: IO[bytes]) -> str | None:
    """What went wrong with the child, in words; None where it answered."""
    request = {"kind": kind, "path": str(Path(path).resolve()), "limits": limits._asdict()}
    # -S: what `site` would add is in the parent's path already
    command = [sys.executable, "-I", "-S", "-c", _BOOT, json.dumps(_import_path()), json.dumps(request)]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=answer, stderr=subprocess.PIPE, env=_environment()
    ) as child:
        complaints = None
        try:
            complaints = _drain(child, limits.wall_s)
        finally:
            if complaints is None:  # it took too long, or the user interrupts
                child.kill()
        if complaints is None:
            return f"decoding took longer than {limits.wall_s:.0f} s; the file is damaged, or the machine too busy"
        status = child.wait()
    return None if status == 0 else _obituary(status, complaints, limits)


def _drain(child: subprocess.Popen[bytes], wall_s: float) -> bytes | None:
    """The end of what the child wrote to its standard error; None where it did not end in time.

    A thread reads, since waiting for a process with a time limit polls and so wastes up to 50 ms.
    """
    kept = bytearray()

    def read() -> None:
        while chunk := os.read(child.stderr.fileno(), 65_536):  # type: ignore[union-attr]  # stderr is a pipe
            kept.extend(chunk)
            del kept[:-4096]

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    reader.join(wall_s)
    return None if reader.is_alive() else bytes(kept)


def _obituary(status: int, complaints: bytes, limits: Limits) -> str:
    if status == -getattr(signal, "SIGXCPU", 0) or status == -getattr(signal, "SIGKILL", 0):
        return f"decoding took more than its {limits.cpu_s:.0f} s of processor time; the file is damaged: copy it again"
    if status < 0 or b"MemoryError" in complaints or b"bad_alloc" in complaints:
        return f"the decoder crashed on it (status {status}); the file is damaged: copy or export it again"
    lines = complaints.decode("utf-8", "replace").strip().splitlines()
    reason = plain_text(lines[-1]) if lines else f"status {status}"
    return f"the decoder failed on it ({reason}); copy or export it again"


def _import_path() -> list[str]:
    """Where the child finds what the parent has imported; never the current folder, which may hold anything."""
    home = str(Path(__file__).resolve().parents[2])
    return [home, *(entry for entry in sys.path if Path(entry).is_absolute())]


def _environment() -> dict[str, str]:
    """What libraries need to load, and no more; one thread a library, for start-up and for the memory limit."""
    kept = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
    return {**kept, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def _read_answer(answer: IO[bytes]) -> Decoded:
    """The child's answer; nothing of it is believed that does not add up."""
    total = answer.seek(0, os.SEEK_END)
    try:
        fields, pixel_bytes = _fields(answer, total)
        if "error" not in fields:
            return _decoded(answer, fields, pixel_bytes)
    except (struct.error, ValueError, TypeError, KeyError, OverflowError) as error:
        raise BadInputError("the decoder's answer does not add up; the file is damaged: copy it again") from error
    raise BadInputError(str(fields["error"]))


def _fields(answer: IO[bytes], total: int) -> tuple[dict[str, Any], int]:
    """The JSON at the end of the answer, and how many bytes of pixels stand before it."""
    answer.seek(max(total - 8, 0))
    (length,) = struct.unpack("<Q", answer.read(8))
    if length > min(total - 8, _LONGEST_JSON):
        raise ValueError("longer than the answer")
    answer.seek(total - 8 - length)
    return dict(json.loads(answer.read(length))), total - 8 - length


def _decoded(answer: IO[bytes], fields: dict[str, Any], pixel_bytes: int) -> Decoded:
    shape, name = tuple(int(side) for side in fields.pop("shape")), fields.pop("dtype")
    if name not in _TYPES or min(shape) < 1 or math.prod(shape) * np.dtype(name).itemsize != pixel_bytes:
        raise ValueError("pixels that are not there")
    flags = {"prot": mmap.PROT_READ, "flags": mmap.MAP_SHARED} if hasattr(mmap, "PROT_READ") else {}
    pixels = mmap.mmap(answer.fileno(), pixel_bytes, **(flags or {"access": mmap.ACCESS_READ}))
    return Decoded(values=np.frombuffer(pixels, name).reshape(shape), **fields)
