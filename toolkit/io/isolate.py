"""Decoding in a child process: a decoder that crashes, hangs or swells takes nothing with it.

The child is forked from a prepared process, or is a fresh interpreter where there is none; both are started through
`subprocess`, so this works in daemonic workers and needs no guard in the user's script. The child's standard output is
a file in memory that both share: the pixels come back without a copy.
"""

from __future__ import annotations

import json
import math
import mmap
import os
import signal
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from toolkit.errors import BadInputError
from toolkit.io import interpreter, prepared
from toolkit.io.decoded import Decoded, Limits
from toolkit.io.interpreter import Ending
from toolkit.io.metadata import plain_text

_LONGEST_JSON = 1 << 20
_TYPES = {"uint8", "uint16", "float32"}
Run = Callable[[str, IO[bytes], float], Ending]


def decode(kind: str, path: str, limits: Limits) -> Decoded:
    """Decode a file of this kind in a child; its pixels are mapped read-only.

    Raises BadInputError: the decoder's own, or what became of the child.
    """
    request = json.dumps({"kind": kind, "path": str(Path(path).resolve()), "limits": limits._asdict()})
    try:
        return _decode_by(prepared.run, request, limits)
    except prepared.NotPreparedError:
        return _decode_by(interpreter.run, request, limits)


def _decode_by(run: Run, request: str, limits: Limits) -> Decoded:
    with _shared_file() as answer:
        ending = run(request, answer, limits.wall_s)
        if ending.status != 0:
            raise BadInputError(_obituary(ending, limits))
        return _read_answer(answer)


def _shared_file() -> IO[bytes]:
    """A nameless file, in memory where the system has such files."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("fit-material-pixels"), "w+b")
    return cast("IO[bytes]", tempfile.TemporaryFile())


def _obituary(ending: Ending, limits: Limits) -> str:
    status, complaints = ending
    if status is None:
        return f"decoding took longer than {limits.wall_s:.0f} s; the file is damaged, or the machine too busy"
    if status == -getattr(signal, "SIGXCPU", 0) or status == -getattr(signal, "SIGKILL", 0):
        return f"decoding took more than its {limits.cpu_s:.0f} s of processor time; the file is damaged: copy it again"
    if status < 0 or b"MemoryError" in complaints or b"bad_alloc" in complaints:
        return f"the decoder crashed on it (status {status}); the file is damaged: copy or export it again"
    lines = complaints.decode("utf-8", "replace").strip().splitlines()
    reason = plain_text(lines[-1]) if lines else f"status {status}"
    return f"the decoder failed on it ({reason}); copy or export it again"


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
