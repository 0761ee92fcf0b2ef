"""The batch as CSV, JSON and Parquet, each with the units and the meaning of its columns."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipelines.report.result import finite
from toolkit.errors import UsageError

from .columns import POOLED, Column
from .materials import Material
from .rows import Cell

SCHEMA = "fit-material/batch/1"
FORMULA = "=+@＝＋－＠-"  # what spreadsheets take for the beginning of a formula or a command
_BEGINS = re.compile(rf"(^|[,;|\t])(?=[\s\"]*[{FORMULA}])")  # of a cell, whatever separates cells where it is opened
Table = Sequence[Mapping[str, Cell]]


def pooled_rows(materials: Sequence[Material]) -> list[dict[str, Cell]]:
    """One row a material, parameter and channel."""
    return [
        {
            "material": material.name,
            "photographs": material.photographs,
            **dict(zip(("model", "variant", "diffuse"), material.lobes or ("", "", ""), strict=True)),
            "parameter": one.name,
            "channel": one.channel,
            "unit": one.unit,
            "count": len(one.members),
            **_pooled(one.pooled),
            "outliers": sum(member.outlier for member in one.members),
        }
        for material in materials
        for one in material.parameters
    ]


def _pooled(found: object) -> dict[str, Cell]:
    """The fields of `Pooled` under their columns' names."""
    renamed = {
        "low": "low95",
        "high": "high95",
        "scatter_low": "scatter_low95",
        "scatter_high": "scatter_high95",
        "expect_low": "expect_low95",
        "expect_high": "expect_high95",
    }
    names = (
        *("mean", "sd", "low", "high", "scatter", "scatter_sd", "scatter_low", "scatter_high", "scatter_moments"),
        *("expect_low", "expect_high", "typical_sd", "i2", "q", "q_p"),
    )
    return {renamed.get(name, name): getattr(found, name, None) for name in names}


def write_csv(path: Path, rows: Table, columns: Sequence[Column]) -> None:
    """RFC 4180 in UTF-8, a header line of the columns' names; no cell of text is a spreadsheet's formula."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\r\n")
        writer.writerow([column.name for column in columns])
        for row in rows:
            writer.writerow([_cell(row.get(column.name)) for column in columns])


def write_dictionary(path: Path, columns: Sequence[Column], pooled: Sequence[Column] = POOLED) -> None:
    """The columns of both tables as a table: which one, column, unit, kind, meaning."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\r\n")
        writer.writerow(["table", "column", "unit", "kind", "meaning"])
        for table, listed in (("batch", columns), ("materials", pooled)):
            writer.writerows([table, one.name, one.unit, one.kind, one.meaning] for one in listed)


def _cell(value: Cell) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return neutral(value)
    return str(finite(value)) if finite(value) is not None else ""


def neutral(text: str) -> str:
    """Text that no spreadsheet runs: an apostrophe before what begins like a formula, also behind a separator, since
    a spreadsheet may take semicolons for it and then sees no quotes around the text.
    """
    return _BEGINS.sub(r"\1'", text)


def write_json(
    path: Path, rows: Table, columns: Sequence[Column], pooled: Table, *, version: str, counts: Mapping[str, int]
) -> None:
    """The whole batch as one object, a photograph a line; what is not available is null."""
    head = {
        "schema": SCHEMA,
        "version": version,
        **counts,
        "columns": {table: [_told(c) for c in listed] for table, listed in (("batch", columns), ("materials", POOLED))},
    }
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(json.dumps(head, indent=1, ensure_ascii=False)[:-2])
        for name, table, listed in (("materials", pooled, POOLED), ("photographs", rows, columns)):
            stream.write(f',\n "{name}": [')
            for index, row in enumerate(table):
                told = finite({column.name: row.get(column.name) for column in listed})
                stream.write(("," if index else "") + "\n  " + json.dumps(told, ensure_ascii=False, allow_nan=False))
            stream.write("\n ]")
        stream.write("\n}\n")


def _told(column: Column) -> dict[str, str]:
    return {"name": column.name, "unit": column.unit, "kind": column.kind, "meaning": column.meaning}


def write_parquet(path: Path, rows: Table, columns: Sequence[Column]) -> None:
    """The same table, typed, unit and meaning in each field's metadata."""
    pa, pq = parquet()
    kinds = {"text": pa.string(), "number": pa.float64(), "whole": pa.int64(), "yes/no": pa.bool_()}
    schema = pa.schema(
        [pa.field(c.name, kinds[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns]
    )
    arrays = [pa.array([row.get(c.name) for row in rows], kinds[c.kind]) for c in columns]
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), path, compression="zstd")


def parquet() -> tuple[Any, Any]:
    """Import pyarrow and its Parquet module; raises UsageError where the extra is not installed."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise UsageError("--parquet needs pyarrow: pip install 'fit-material[parquet]'") from error
    return pa, pq
