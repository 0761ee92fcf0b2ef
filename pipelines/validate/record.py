"""The record of a validation: one line a finished trial, on the disk before the next; what a restart begins from."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from toolkit import __version__
from toolkit.errors import UsageError

from .design import Trial, fingerprint

NAME = "trials.jsonl"
SCHEMA = "fit-material/trials/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """An open record; `before` holds the lines of an earlier run of the same trials."""

    stream: IO[bytes]
    before: tuple[Mapping[str, Any], ...]

    def add(self, line: Mapping[str, Any]) -> None:
        """Keep a line; returns when the disk holds it."""
        self.stream.write(json.dumps(line, allow_nan=False).encode() + b"\n")
        self.stream.flush()
        os.fsync(self.stream.fileno())


@contextmanager
def opened(folder: Path, trials: Sequence[Trial], *, resume: bool, discrepancy: bool = True) -> Iterator[Record]:
    """The record in `folder`, begun anew unless `resume`; raises UsageError where it is of other trials."""
    path, design = folder / NAME, fingerprint(trials)
    lines = list(_lines(path)) if resume and path.exists() else []
    header, done = (lines[0], lines[1:]) if lines else ({}, [])
    mine = {"schema": SCHEMA, "version": __version__, "design": design, "discrepancy": discrepancy}
    if header and dict(header) != mine:
        raise UsageError(f"{path} is of other trials, another version or another --discrepancy; expected --overwrite")
    with path.open("ab" if header else "wb") as stream:
        record = Record(stream=stream, before=tuple({line["number"]: line for line in done}.values()))
        if header:
            _close_torn_line(path, stream)
        else:
            record.add(mine)
        yield record


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """Every whole line; one that a crash cut short is passed over."""
    with path.open("rb") as stream:
        for text in stream:
            try:
                line = json.loads(text)
            except ValueError:
                continue
            if isinstance(line, dict):
                yield line


def _close_torn_line(path: Path, stream: IO[bytes]) -> None:
    with path.open("rb") as held:
        held.seek(-1, os.SEEK_END)
        if held.read(1) != b"\n":
            stream.write(b"\n")
