"""The journal of a batch: one line a photograph that ended, on the disk before the next is told of.

It is only ever appended to. A line that a crash cut short is passed over, and closed before the next is written.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from pipelines.report.folder import sync
from toolkit.errors import UsageError

from .job import Outcome

NAME = "batch.journal.jsonl"
SCHEMA = "fit-material/journal/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Journal:
    """An open journal; `before` is what it held when it was opened: the last line of each place."""

    stream: IO[bytes]
    version: str
    before: Mapping[str, Mapping[str, Any]]

    def ended(self, place: str, settings: str, outcome: Outcome) -> None:
        """Note how a photograph ended; returns when the disk holds it."""
        line = {
            "place": place,
            "input": outcome.input,
            "settings": settings,
            "version": self.version,
            "status": "failed" if outcome.status == "failed" else "done",
            "error": outcome.error,
            "code": outcome.code,
            "lasting": outcome.lasting,
            "result": outcome.result,
            "seconds": round(outcome.seconds, 3),
        }
        _append(self.stream, line)


@contextmanager
def journal(out_dir: Path, *, version: str, resume: bool) -> Iterator[Journal]:
    """The journal of `out_dir`, begun where there is none or where `resume` is False.

    Raises UsageError where another batch is writing there, or where it was begun by another version.
    """
    path = out_dir / NAME
    fresh = not resume or not path.exists()
    with path.open("a+b") as stream:
        _alone(stream, out_dir)
        if fresh:
            stream.truncate(0)
        header, before = _read(path)
        if header is not None and header != version:
            raise UsageError(
                f"{out_dir} holds results of fit-material {header}, this is {version}; expected the same version, "
                "--overwrite, or another --out"
            )
        if not fresh or header is not None:
            _close_torn_line(stream, path)
        if header is None:
            _append(stream, {"schema": SCHEMA, "version": version})
            sync(out_dir)
        yield Journal(stream=stream, version=version, before=before)


def _alone(stream: IO[bytes], out_dir: Path) -> None:
    """Hold the journal as long as it is open; the system lets go when the process ends, however it ends."""
    try:
        import fcntl
    except ImportError:  # Windows
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise UsageError(f"another batch is writing to {out_dir}; expected another --out, or to wait for it") from error
    except OSError:  # a file system without locks
        return


def _read(path: Path) -> tuple[str | None, dict[str, Mapping[str, Any]]]:
    """The version it was begun with, and the last line of each place."""
    version: str | None = None
    lines: dict[str, Mapping[str, Any]] = {}
    for entry in _entries(path):
        if entry.get("schema") == SCHEMA and isinstance(entry.get("version"), str):
            version = version or entry["version"]
        elif isinstance(entry.get("place"), str):
            lines[entry["place"]] = entry
    return version, lines


def _entries(path: Path) -> Iterator[dict[str, Any]]:
    with path.open("rb") as stream:
        for line in stream:
            try:
                entry = json.loads(line)
            except (ValueError, RecursionError):  # cut short by a crash
                continue
            if isinstance(entry, dict):
                yield entry


def _close_torn_line(stream: IO[bytes], path: Path) -> None:
    with path.open("rb") as held:
        held.seek(0, os.SEEK_END)
        if held.tell() == 0:
            return
        held.seek(-1, os.SEEK_END)
        torn = held.read(1) != b"\n"
    if torn:
        stream.write(b"\n")


def _append(stream: IO[bytes], line: Mapping[str, Any]) -> None:
    stream.write(json.dumps(line, ensure_ascii=True).encode() + b"\n")
    stream.flush()
    os.fsync(stream.fileno())
