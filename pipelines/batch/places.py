"""Where each result goes: below one folder, mirroring the inputs' own paths, under names that no system misreads."""

from __future__ import annotations

import hashlib
import os
import unicodedata
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from pipelines.report.text import stem
from toolkit.errors import BadInputError, UsageError

from .photograph import Photograph

RESERVED = "batch."  # the batch's own files stand beside the mirrored folders
MOST_PARTS = 40
MARK = 8  # letters of the digest that tells two like names apart


def places(photographs: Sequence[Photograph]) -> list[PurePosixPath]:
    """A relative folder for each photograph's result, no two alike on any file system.

    `day1/ball.dng` goes to `day1/ball.fit`. Where two would meet (`ball.dng` and `ball.png`, or names that differ in
    case or in forbidden characters only) each gets a few letters of its own path's digest. Raises UsageError where
    even so two meet, which takes intent.
    """
    plain = [_place(one.under) for one in photographs]
    meeting = Counter(map(_folded, plain))
    names = Counter(one.under for one in photographs)
    chosen = [
        place if meeting[_folded(place)] == 1 else _marked(place, one, alike=names[one.under] > 1)
        for place, one in zip(plain, photographs, strict=True)
    ]
    place, times = Counter(map(_folded, chosen)).most_common(1)[0]
    if times > 1:
        raise UsageError(f"{times} photographs would write to {place}; expected names that differ")
    return chosen


def _place(under: Sequence[str]) -> PurePosixPath:
    *folders, name = [part for part in under if part not in ("", ".", "/", "\\")] or [""]
    return PurePosixPath(*map(_folder, folders[-MOST_PARTS:]), f"{stem(name)}.fit")


def _folder(part: str) -> str:
    """A folder's name made safe; never one that the batch itself uses."""
    kept = stem(part + ".x")  # a folder has no suffix to lose
    taken = kept.lower().startswith(RESERVED) or kept.lower().endswith(".fit")
    return f"_{kept}_" if taken else kept


def _folded(place: PurePosixPath) -> str:
    """What a file system that ignores case and composes letters takes a name for."""
    return unicodedata.normalize("NFKC", str(place)).casefold()


def _marked(place: PurePosixPath, one: Photograph, *, alike: bool) -> PurePosixPath:
    """With letters of the path as written; of the whole path where two were written alike."""
    told = os.path.abspath(one.path) if alike else "/".join(one.under)  # noqa: PTH100  # links stay what they are
    digest = hashlib.sha256(told.encode("utf-8", "surrogatepass")).hexdigest()[:MARK]
    return place.with_name(f"{place.name.removesuffix('.fit')}-{digest}.fit")


def inside(out_dir: Path, place: PurePosixPath) -> Path:
    """The folder itself; raises BadInputError where a link in `out_dir` leads out of it."""
    home, path = out_dir.resolve(), out_dir / place
    if not path.resolve().is_relative_to(home):
        raise BadInputError(f"{path} leads out of {out_dir} by a link; expected a folder of results without links")
    return path
