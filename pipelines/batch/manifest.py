"""A manifest: a table (CSV) or TOML file that names photographs with their scene, material and group."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipelines.layers import shown
from pipelines.told import numbers
from toolkit.errors import BadInputError, UsageError

from .inputs import as_written
from .photograph import Photograph

MAX_BYTES = 1 << 25  # a hundred thousand photographs
TEXTS = ("image", "scene", "material", "group", "light", "sphere")
EXPECTED = "expected the columns image and, where wanted, scene, material, group, light (X,Y,Z), sphere (CX,CY,R)"


def manifest(path: Path) -> Iterator[Photograph]:
    """The photographs of a manifest; paths in it are relative to its own folder.

    CSV: a header line with some of the columns `TEXTS`. TOML: `[[photograph]]` tables with the same keys and
    `settings`, a table as in a scene file. Raises BadInputError that names the line or the table's number.
    """
    data = _bytes(path)
    entries = _of_toml(data, path.name) if path.suffix.lower() == ".toml" else _of_csv(data, path.name)
    for where, entry in entries:
        yield _photograph(entry, path.parent, where)


def _bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except OSError as error:
        raise BadInputError(f"{shown(path.name)}: cannot be read: {error.strerror}; expected a manifest") from error
    if len(data) > MAX_BYTES:
        raise BadInputError(f"{shown(path.name)} is larger than {MAX_BYTES >> 20} MiB; expected a manifest")
    return data


def _of_csv(data: bytes, name: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    try:
        text = data.decode("utf-8-sig")
        first = text.partition("\n")[0]
        separator = next((mark for mark in (";", "\t") if mark in first and "," not in first), ",")
        table = csv.DictReader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
        columns = [column.strip() for column in table.fieldnames or ()]
        table.fieldnames = columns
        unknown = sorted(set(columns) - set(TEXTS))
        if "image" not in columns or unknown or len(set(columns)) < len(columns):
            found = ", ".join(map(shown, columns)) or "nothing"
            raise BadInputError(f"{shown(name)}: found the columns {shown(found)}; {EXPECTED}")
        for row in table:
            where = f"{shown(name)}, line {table.line_num}"
            if None in row or None in row.values():
                raise BadInputError(f"{where}: found another number of cells than columns; expected {len(columns)}")
            yield where, {key: cell.strip() for key, cell in row.items() if cell.strip()}
    except (UnicodeDecodeError, csv.Error) as error:
        raise BadInputError(f"{shown(name)}: {shown(str(error))}; expected a table of UTF-8 text (CSV)") from error


def _of_toml(data: bytes, name: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    import tomllib

    try:
        found = tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInputError(f"{shown(name)}: {shown(str(error))}; expected a manifest in TOML") from error
    entries = found.get("photograph")
    if set(found) != {"photograph"} or not isinstance(entries, list):
        keys = ", ".join(sorted(map(shown, found))) or "nothing"
        raise BadInputError(
            f"{shown(name)}: found {shown(keys)}; expected [[photograph]] tables (a scene file goes to --scene)"
        )
    for number, entry in enumerate(entries, 1):
        where = f"{shown(name)}, photograph {number}"
        _check_table(entry, where)
        yield where, entry


def _check_table(entry: object, where: str) -> None:
    if not isinstance(entry, dict):
        raise BadInputError(f"{where}: found {shown(str(entry))}; expected a table")
    for key, value in entry.items():
        kind, word = (dict, "a table") if key == "settings" else (str, "text")
        if key not in (*TEXTS, "settings"):
            raise BadInputError(f"{where}: found the key {shown(key)}; expected {', '.join(TEXTS)} or settings")
        if not isinstance(value, kind):
            raise BadInputError(f"{where}: {key} is {shown(repr(value))}; expected {word}")


def _photograph(entry: Mapping[str, Any], home: Path, where: str) -> Photograph:
    name = entry.get("image", "")
    if not name:
        raise BadInputError(f"{where}: found no image; expected the path of a photograph")
    if "\0" in name + entry.get("scene", ""):
        raise BadInputError(f"{where}: found a zero byte in a path; expected the path of a file")
    return Photograph(
        path=home / name,
        under=as_written(Path(name)),
        material=entry.get("material", ""),
        group=entry.get("group", ""),
        scene=home / entry["scene"] if entry.get("scene") else None,
        settings={**_columns(entry, where), **entry.get("settings", {})},
    )


def _columns(entry: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The settings that columns of their own may give."""
    found: dict[str, Any] = {}
    if entry.get("light"):
        found["light"] = [{"kind": "directional", "direction": _numbers(entry["light"], "X,Y,Z", where, "light")}]
    if entry.get("sphere"):
        x, y, radius = _numbers(entry["sphere"], "CX,CY,R", where, "sphere")
        found["sphere"] = {"centre_px": [x, y], "radius_px": radius}
    return found


def _numbers(text: str, form: str, where: str, column: str) -> list[float]:
    try:
        return numbers(column, text.replace(";", ",").replace(" ", ""), form)
    except UsageError as error:
        raise BadInputError(f"{where}: {error}") from error
