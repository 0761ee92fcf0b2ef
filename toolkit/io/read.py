"""Reading a photograph: which decoder, in a process of its own, with limits; the pixels as stored."""

from __future__ import annotations

import hashlib
import os
import threading
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from toolkit.errors import BadInputError
from toolkit.io import decode, isolate
from toolkit.io.decoded import Decoded, Limits
from toolkit.io.kinds import kind_of
from toolkit.io.metadata import plain_text
from toolkit.records import Metadata, RawFrame

DEFAULT_LIMITS = Limits()


def read(path: str | os.PathLike[str], *, limits: Limits = DEFAULT_LIMITS) -> RawFrame:
    """The photograph in a file: a mosaic from a camera raw, or three colours from EXR, PNG, TIFF, Radiance and others.

    The decoder runs in a child process within `limits`; the pixels are mapped from memory shared with it, read-only.
    Raises BadInputError, in one line, for what is missing, damaged, too large, not of three colours, or no photograph.
    """
    return _read(os.fspath(path), limits, isolated=True)


def read_in_process(path: str | os.PathLike[str], *, limits: Limits = DEFAULT_LIMITS) -> RawFrame:
    """As `read`, but within this process: for trusted files and tests. No limit on time or memory holds."""
    return _read(os.fspath(path), limits, isolated=False)


def _read(path: str, limits: Limits, *, isolated: bool) -> RawFrame:
    name = plain_text(Path(path).name)
    try:
        kind = kind_of(path)
        _check_bytes(Path(path).stat().st_size, limits)
        with _Digest(path) as digest:
            decoded = isolate.decode(kind, path, limits) if isolated else decode.decode(kind, path, limits)
        return _frame(name, digest.value, decoded)
    except BadInputError as error:
        raise BadInputError(f"{name}: {plain_text(error)}") from error


def _check_bytes(found: int, limits: Limits) -> None:
    if found > limits.file_bytes:
        raise BadInputError(
            f"a file of {found / 1e9:.1f} GB; at most {limits.file_bytes / 1e9:.1f} GB are read: crop it"
        )


class _Digest:
    """The SHA-256 of a file, computed while its pixels are decoded."""

    def __init__(self, path: str) -> None:
        self._path = path
        self.value = ""
        self._failure = ""
        self._thread = threading.Thread(target=self._compute, daemon=True)

    def _compute(self) -> None:
        try:
            with Path(self._path).open("rb") as file:
                self.value = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            self._failure = f"cannot be read to its end ({error.strerror}); copy it again"

    def __enter__(self) -> _Digest:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.join()
        if self._failure:
            raise BadInputError(self._failure)


def _frame(name: str, sha256: str, decoded: Decoded) -> RawFrame:
    return RawFrame(
        name=name,
        sha256=sha256,
        format=cast(Literal["raw", "exr", "png", "tiff", "hdr", "image"], decoded.format),
        encoding=cast(Literal["linear", "encoded"], decoded.encoding),
        values=decoded.values,
        cfa=None if decoded.cfa is None else np.array(decoded.cfa, np.uint8),
        black=np.array(decoded.black, float),
        white=np.array(decoded.white, float),
        metadata=_metadata(decoded.metadata),
    )


def _metadata(found: dict[str, Any]) -> Metadata:
    """The record; lists that came as JSON become tuples."""
    return Metadata(**cast("dict[str, Any]", _tuples(found)))


def _tuples(value: object) -> object:
    if isinstance(value, dict):
        return {name: _tuples(item) for name, item in value.items()}
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
