"""What a path holds that can be compared: one result, or a batch's."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pipelines.report.stored import read_result
from pipelines.report.text import clean
from toolkit.errors import BadInputError

from .card import SUFFIX
from .finish import OBJECT
from .places import inside

MAX_BYTES = 1 << 28


@dataclass(frozen=True, slots=True, kw_only=True)
class Held:
    """What a path holds: results by name (one of them, or a batch's), and a batch's pooled numbers."""

    path: Path
    one: bool
    results: Mapping[str, Mapping[str, Any]]
    pooled: Mapping[tuple[str, ...], tuple[float, float]]
    failed: frozenset[str] = frozenset()


def hold(path: Path) -> Held:
    """Read STEM.json, a folder of one result, or a batch's folder; raises BadInputError for anything else."""
    if (path / OBJECT).is_file():
        return _batch(path)
    file = path if path.is_file() else _result_in(path) if path.is_dir() else None
    result = _result(file) if file is not None else {}
    if file is None or not result:
        raise BadInputError(f"{path} holds no result; expected STEM.json, its folder, or the folder of a batch")
    return Held(path=path, one=True, results={clean(file.stem): result}, pooled={})


def _result_in(folder: Path) -> Path | None:
    others = (SUFFIX, ".run.json")
    found = [path for path in sorted(folder.glob("*.json")) if not path.name.endswith(others)]
    return found[0] if len(found) == 1 else None


def _result(path: Path) -> dict[str, Any]:
    """A result with fits; empty for another object."""
    found = read_result(path)
    return found if found.get("schema") == "fit-material/1" and isinstance(found.get("fits"), list) else {}


def _batch(path: Path) -> Held:
    told = _object(path / OBJECT)
    results, failed = {}, set()
    for row in told["photographs"]:
        name = str(row.get("place"))
        folder = inside(path, PurePosixPath(name))
        file = _result_in(folder) if folder.is_dir() else None
        result = _result(file) if file is not None and row.get("status") == "done" else {}
        if result:
            results[name] = result
        else:
            failed.add(name)
    return Held(path=path, one=False, results=results, pooled=dict(_pooled(told)), failed=frozenset(failed))


def _object(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_bytes()) if path.stat().st_size <= MAX_BYTES else None
    except (OSError, ValueError, RecursionError) as error:
        raise BadInputError(f"{path} cannot be read as a batch's table; expected the folder of a batch") from error
    rows = found.get("photographs") if isinstance(found, dict) else None
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise BadInputError(f"{path} is no batch's table; expected the folder of a batch")
    return found if isinstance(found, dict) else {}


def _pooled(told: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], tuple[float, float]]]:
    for row in told.get("materials") or ():
        keys = ("material", "model", "variant", "diffuse", "parameter", "channel")
        if isinstance(row, dict) and is_number(row.get("mean")) and is_number(row.get("sd")):
            yield tuple(str(row.get(key)) for key in keys), (row["mean"], row["sd"])


def is_number(value: object) -> bool:
    """Whether a value of a file can be calculated with."""
    return isinstance(value, float | int) and math.isfinite(value)
