"""The decoders' own process: limits first, then decode, check, and hand the pixels over. See isolate.py."""

from __future__ import annotations

import json
import os
import signal
import struct
import sys
from typing import TYPE_CHECKING, Any

from toolkit.errors import BadInputError
from toolkit.io.decode import decode
from toolkit.io.decoded import Limits

if TYPE_CHECKING:
    from numpy.typing import NDArray

_ROWS = 256  # written at once, so that turned or cropped pixels are never copied whole


def main(request: str) -> None:
    """Decode as the JSON `request` says and write the answer to what was standard output.

    The answer: the pixels, from the first byte on; then JSON, {"error": text} or the fields; its length in 8 bytes.
    """
    asked = json.loads(request)
    limits = Limits(**asked["limits"])
    answer = os.dup(1)
    os.dup2(2, 1)  # whatever a library prints must not land among the pixels
    path = _plain_path(asked["path"])
    limit_process(limits, os.path.getsize(path))  # noqa: PTH202  # pathlib costs start-up
    values, fields = _answer(asked["kind"], path, limits)
    _write(answer, values, fields)
    os._exit(0)  # nothing is left to tidy, and libraries' exit handlers cost time or crash


def _plain_path(path: str) -> str:
    """The path, or another to the same file where its name is no Unicode, which some libraries insist on."""
    if path.isprintable() or not os.path.isdir("/proc/self/fd"):  # noqa: PTH112  # as above
        return path
    return f"/proc/self/fd/{os.open(path, os.O_RDONLY)}"


def _answer(kind: str, path: str, limits: Limits) -> tuple[Any, dict[str, Any]]:
    try:
        decoded = decode(kind, path, limits)
    except BadInputError as error:
        return None, {"error": str(error)}
    fields = decoded._asdict()
    values = fields.pop("values")
    return values, {**fields, "shape": values.shape, "dtype": values.dtype.name}


def limit_process(limits: Limits, file_bytes: int) -> None:
    """Bind this process to its memory and processor time, and the libraries to their pixels, before they load."""
    for name, value in {"PIXELS": limits.pixels, "WIDTH": 1 << 17, "HEIGHT": 1 << 17}.items():
        os.environ[f"OPENCV_IO_MAX_IMAGE_{name}"] = str(value)
    try:
        import resource
    except ImportError:  # not on Windows: there the parent's clock and the size check remain
        return
    signal.setitimer(signal.ITIMER_REAL, limits.wall_s + 1)  # should nobody be left who stops it
    memory, seconds = limits.memory_for(file_bytes), limits.cpu_for(file_bytes)
    for what, limit, beyond in (
        (resource.RLIMIT_AS, memory, 0),
        (resource.RLIMIT_CPU, seconds, 1),  # at the lower limit comes SIGXCPU, which says why
        (resource.RLIMIT_FSIZE, memory, 0),  # the answer lies in memory too, and was an array before
        (resource.RLIMIT_CORE, 0, 0),
    ):
        hard = resource.getrlimit(what)[1]
        bounds = [wish if hard == resource.RLIM_INFINITY else min(wish, hard) for wish in (limit, limit + beyond)]
        resource.setrlimit(what, (bounds[0], bounds[1]))


def _write(answer: int, values: NDArray[Any] | None, fields: dict[str, Any]) -> None:
    with os.fdopen(answer, "wb") as file:
        if values is not None:
            for start in range(0, len(values), _ROWS):
                rows = values[start : start + _ROWS]
                file.write((rows if rows.flags.c_contiguous else rows.copy()).data)
        text = json.dumps(fields).encode()
        file.write(text + struct.pack("<Q", len(text)))


if __name__ == "__main__":
    main(sys.argv[1])
