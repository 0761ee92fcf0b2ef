"""The batch's own files, whole or not at all, from the results that stand in its folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.report.folder import whole

from .columns import POOLED, columns
from .materials import Material, materials
from .rows import Row, row_of
from .tables import pooled_rows, write_csv, write_dictionary, write_json, write_parquet

if TYPE_CHECKING:
    from .plan import Options
    from .whole import Ending

PAGE, TABLE, OBJECT = "batch.html", "batch.csv", "batch.json"
PARQUET, MATERIALS, DICTIONARY = "batch.parquet", "batch.materials.csv", "batch.columns.csv"
OPTIONAL = (PARQUET,)


def finish(ending: Ending, options: Options) -> None:
    """Write tables and page, each synced and renamed into its place."""
    rows = [
        row_of(item.photographs, item.place, outcome, options.out)
        for item, outcome in zip(ending.items, ending.outcomes, strict=True)
    ]
    named = materials(rows)
    rows = marked(rows, named)
    with whole(options.out, last=OBJECT) as draft:
        _write(draft, rows, named, options)
    ending.flags = sorted({flag for row in rows for flag in str(row.cells.get("flags") or "").split()})
    if not options.parquet:
        (options.out / PARQUET).unlink(missing_ok=True)


def marked(rows: list[Row], named: list[Material]) -> list[Row]:
    """The rows with their column `outlier` filled where it can be told."""
    far: Mapping[int, bool] = {row: row in one.outliers for one in named for row in one.rows}
    return [
        replace(row, cells={**row.cells, "outlier": far.get(index)} if row.cells["status"] == "done" else row.cells)
        for index, row in enumerate(rows)
    ]


def _write(draft: Path, rows: list[Row], named: list[Material], options: Options) -> None:
    from .page import write_page

    told, cells = columns(rows), [row.cells for row in rows]
    failed = sum(row.cells["status"] == "failed" for row in rows)
    counts = {"count": len(rows), "done": len(rows) - failed, "failed": failed}
    pooled = pooled_rows(named)
    write_csv(draft / TABLE, cells, told)
    write_csv(draft / MATERIALS, pooled, POOLED)
    write_dictionary(draft / DICTIONARY, told)
    if options.parquet:
        write_parquet(draft / PARQUET, cells, told)
    write_page(draft / PAGE, rows, named, told, out_dir=options.out)
    write_json(draft / OBJECT, cells, told, pooled, version=options.version, counts=counts)
