"""Results of an earlier run: kept only where they are of these very photographs, these settings and this version."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import toolkit
from pipelines.files import card_file, chart_file, digest_if_any, digest_of
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
    found = [one for one in result.get("photographs") or [result] if isinstance(one, dict)]
    images = [digest_of(image) for image, _ in asked]
    cards = [digest_if_any(card_file(own, image.parent)) for image, own in asked]
    charts = [digest_if_any(chart_file(own, image.parent)) for image, own in asked]
    numbers = ["", *(f"-{number}" for number in range(2, len(asked) + 1))]
    told = [_read_back(Path(f"{written}.settings{number}.toml")) for number in numbers]
    return [
        ("another image", images == [_inner(one, "image", "sha256") for one in found]),
        ("another grey card", cards == [_inner(one, "reference", "sha256") for one in found]),
        ("another colour chart", charts == [_inner(one, "colour", "chart_sha256") for one in found]),
        ("other settings", told == [settings for _, settings in asked]),
        ("another version", _inner(result, "software", "fit-material") == toolkit.__version__),
    ]


def _read_back(path: Path) -> Settings | None:
    try:
        return read_settings(path)
    except FitMaterialError:
        return None


def _inner(result: Mapping[str, Any], table: str, key: str) -> object:
    inner = result.get(table)
    return inner.get(key) if isinstance(inner, dict) else None
