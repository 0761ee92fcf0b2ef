"""What the words of the command line name: files, folders, globs, lists, manifests."""

from __future__ import annotations

import glob
import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from toolkit.errors import BadInputError, UsageError

from .photograph import Photograph, is_photograph

MAX_LIST_BYTES = 1 << 26
MANIFESTS = (".csv", ".toml")


def photographs(
    words: Sequence[str], *, files_from: str | None = None, leave_out: Path | None = None
) -> list[Photograph]:
    """Every photograph named, in order, each once.

    A folder stands for all photographs below it, without `leave_out` and without folders of results (`*.fit`);
    a file ending in .csv or .toml is a manifest. Raises UsageError where nothing is found, BadInputError for a list
    or manifest that cannot be read.
    """
    lines = _listed(files_from) if files_from is not None else []
    found: dict[Path, Photograph] = {}
    for word in words:
        for one in _of_word(word, leave_out):
            found.setdefault(_same(one.path), one)
    for line in lines:
        found.setdefault(_same(Path(line)), _file(Path(line)))
    if not found:
        raise UsageError("found no photograph; expected files, folders, globs, a manifest, or --files-from")
    return list(found.values())


def _same(path: Path) -> Path:
    """What makes two names one file; links are followed by the system, not here."""
    return Path(os.path.abspath(path))  # noqa: PTH100  # resolve() would follow links: two links are two photographs


def _of_word(word: str, leave_out: Path | None) -> Iterator[Photograph]:
    path = Path(word)
    if path.is_dir():
        yield from _folder(path, path, leave_out)
    elif path.suffix.lower() in MANIFESTS:
        from .manifest import manifest

        yield from manifest(path)
    elif not path.exists() and glob.has_magic(word):
        yield from _glob(word, leave_out)
    else:
        yield _file(path)


def _file(path: Path) -> Photograph:
    return Photograph(path=path, under=as_written(path))


def as_written(path: Path) -> tuple[str, ...]:
    """The parts of a relative path that stays below; of any other its last part."""
    return path.parts if path.parts and not path.is_absolute() and ".." not in path.parts else (path.name,)


def _folder(path: Path, root: Path, leave_out: Path | None) -> Iterator[Photograph]:
    for here, folders, names in os.walk(path):  # does not follow links to folders: no endless walk
        place = Path(here)
        folders[:] = sorted(name for name in folders if _entered(place / name, leave_out))
        for name in sorted(names):
            if is_photograph(Path(name)) and not name.startswith("."):
                yield Photograph(path=place / name, under=(*place.relative_to(root).parts, name))


def _entered(folder: Path, leave_out: Path | None) -> bool:
    hidden = folder.name.startswith(".") or folder.name.endswith(".fit")
    return not hidden and (leave_out is None or not leave_out.exists() or not folder.samefile(leave_out))


def _glob(word: str, leave_out: Path | None) -> Iterator[Photograph]:
    """Results mirror what lies below the part without wildcards."""
    parts = Path(word).parts
    plain = next(i for i, part in enumerate(parts) if glob.has_magic(part))
    root = Path(*parts[:plain])
    for name in sorted(glob.glob(word, recursive=True)):  # noqa: PTH207  # pathlib's own differs by Python version
        path = Path(name)
        if path.is_dir():
            if parts[-1] != "**":
                yield from _folder(path, root, leave_out)
        elif is_photograph(path) and not _among_results(path, leave_out):
            yield Photograph(path=path, under=path.relative_to(root).parts)


def _among_results(path: Path, leave_out: Path | None) -> bool:
    return any(part.endswith(".fit") for part in path.parts[:-1]) or (
        leave_out is not None and _same(path).is_relative_to(_same(leave_out))
    )


def _listed(source: str) -> list[str]:
    """Paths, one a line, or separated by zero bytes as `find -print0` gives them; `-` is stdin."""
    try:
        if source == "-":
            data = sys.stdin.buffer.read(MAX_LIST_BYTES + 1)
        else:
            with Path(source).open("rb") as stream:
                data = stream.read(MAX_LIST_BYTES + 1)
    except OSError as error:
        raise BadInputError(
            f"--files-from {source}: {error.strerror}; expected a file of paths, one a line, or -"
        ) from error
    if len(data) > MAX_LIST_BYTES:
        raise BadInputError(f"--files-from {source}: more than {MAX_LIST_BYTES >> 20} MiB; expected paths, one a line")
    lines = data.split(b"\0") if b"\0" in data else re.split(rb"\r?\n", data)
    return [os.fsdecode(line) for line in lines if line.strip()]
