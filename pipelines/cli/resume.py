"""Results of an earlier run: kept only where they are of this very image, these settings and this version."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import toolkit
from pipelines.layers import read_settings
from pipelines.report.stored import read_result
from pipelines.report.text import stem
from toolkit.errors import FitMaterialError, UsageError

if TYPE_CHECKING:
    from pipelines.settings import Settings


def finished(asked: Sequence[tuple[Path, Settings]], out: Path) -> Mapping[str, Any] | None:
    """The result object in `out` of one image or of several fitted jointly, None where a run did not end.

    Raises UsageError where it is of something else.
    """
    name = stem(asked[0][0].name)
    result = read_result(out / f"{name}.json")
    if result.get("status") != "ok":
        return None
    different = [what for what, same in _same(asked, result, out / name) if not same]
    if different:
        raise UsageError(f"{out} holds a result of {' and '.join(different)}; expected --overwrite to replace it")
    return result


def _same(asked: Sequence[tuple[Path, Settings]], result: Mapping[str, Any], written: Path) -> list[tuple[str, bool]]:
    found = result.get("photographs") or [result]
    digests = [_inner(one, "image", "sha256") for one in found if isinstance(one, dict)]
    numbers = ["", *(f"-{number}" for number in range(2, len(asked) + 1))]
    told = [_read_back(Path(f"{written}.settings{number}.toml")) for number in numbers]
    return [
        ("another image", digests == [_digest(image) for image, _ in asked]),
        ("other settings", told == [settings for _, settings in asked]),
        ("another version", _inner(result, "software", "fit-material") == toolkit.__version__),
    ]


def _digest(image: Path) -> str:
    with image.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _read_back(path: Path) -> Settings | None:
    try:
        return read_settings(path)
    except FitMaterialError:
        return None


def _inner(result: Mapping[str, Any], table: str, key: str) -> object:
    inner = result.get(table)
    return inner.get(key) if isinstance(inner, dict) else None
