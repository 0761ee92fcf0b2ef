"""Results of an earlier run: kept only where they are of this very image, these settings and this version."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import toolkit
from pipelines.layers import read_settings
from pipelines.report.stored import read_result
from pipelines.report.text import stem
from toolkit.errors import FitMaterialError, UsageError

if TYPE_CHECKING:
    from pipelines.settings import Settings


def finished(image: Path, out: Path, settings: Settings) -> Mapping[str, Any] | None:
    """The result object in `out`, None where a run did not end; raises UsageError where it is of something else."""
    name = stem(image.name)
    result = read_result(out / f"{name}.json")
    if result.get("status") != "ok":
        return None
    different = [what for what, same in _same(image, settings, result, out / f"{name}.settings.toml") if not same]
    if different:
        raise UsageError(f"{out} holds a result of {' and '.join(different)}; expected --overwrite to replace it")
    return result


def _same(image: Path, settings: Settings, result: Mapping[str, Any], written: Path) -> list[tuple[str, bool]]:
    with image.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return [
        ("another image", _inner(result, "image", "sha256") == digest),
        ("other settings", _read_back(written) == settings),
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
