"""Files that appear whole or not at all: made in a hidden folder beside their place, synced, then renamed."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipelines.interrupts import interrupts_held
from toolkit.errors import FitMaterialError, UsageError

_CALLERS_MISTAKE = {
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.EEXIST,
}


@contextmanager
def whole(out_dir: Path, *, last: str) -> Iterator[Path]:
    """Give an empty folder to write into; on leaving without an error its files stand in `out_dir`.

    The file named `last` says that all others are there: an old one goes first, the new one comes last. On any
    error or interrupt `out_dir` is as it was. Raises UsageError where `out_dir` cannot be written to, and
    FitMaterialError where the disk is full.
    """
    try:
        yield from _whole(out_dir, last)
    except OSError as error:
        raise explained(error, out_dir) from error


def _whole(out_dir: Path, last: str) -> Iterator[Path]:
    exists = out_dir.is_dir()
    home = out_dir if exists else out_dir.parent
    home.mkdir(parents=True, exist_ok=True)
    draft: Path | None = None
    try:
        with interrupts_held():
            draft = Path(tempfile.mkdtemp(prefix=".fit-material-", suffix=".part", dir=home))
        yield draft
        for path in draft.iterdir():
            sync(path)
        draft.chmod(0o777 & ~_umask())
        if exists or out_dir.exists():
            _move_into(draft, out_dir, last)
        else:
            draft.rename(out_dir)
            sync(out_dir)
        sync(home)
    finally:
        if draft is not None:
            shutil.rmtree(draft, ignore_errors=True)


def _move_into(draft: Path, out_dir: Path, last: str) -> None:
    (out_dir / last).unlink(missing_ok=True)
    for path in sorted(draft.iterdir(), key=lambda path: (path.name == last, path.name)):
        path.replace(out_dir / path.name)


def sync(path: Path) -> None:
    """Wait until the disk holds it; a rename before that could survive a power cut that the bytes do not."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def begin_sync(handle: int, start: int, length: int) -> None:
    """Ask the disk to take a part of an open file while the rest is made: `sync` then has less to wait for."""
    if hasattr(os, "posix_fadvise"):  # what is not written yet is kept, and its writing begins
        os.posix_fadvise(handle, start, length, os.POSIX_FADV_DONTNEED)


def _umask() -> int:
    """The process's umask; there is no way to ask but to set it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def explained(error: OSError, out_dir: Path) -> FitMaterialError:
    """What keeps files from being written into a folder, in one line: the caller's mistake, or the disk's state."""
    reason = (error.strerror or str(error)).lower()
    if error.errno in _CALLERS_MISTAKE:
        return UsageError(f"cannot write to {out_dir}: {reason}; choose another folder with --out")
    return FitMaterialError(f"cannot write to {out_dir}: {reason}; free some space or choose another folder with --out")
