"""batch.html: the whole batch on one page that needs nothing else; it reads without scripts, and sorts with one."""

from __future__ import annotations

import base64
import hashlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipelines.report.template import STYLE, template
from toolkit.flags import MEANING

from .columns import POOLED, Column
from .materials import Material
from .page_materials import material_section
from .page_photographs import photograph_rows, swatch
from .plots import COLOURS, gloss_plot
from .rows import Row

TEMPLATES = Path(__file__).parent / "templates"


def write_page(
    path: Path, rows: Sequence[Row], named: Sequence[Material], told: Sequence[Column], *, out_dir: Path
) -> None:
    """Write the page, row by row."""
    context = _context(rows, named, told, out_dir)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        for piece in template(TEMPLATES / "batch.html.j2").generate(context):
            stream.write(piece)


def _context(rows: Sequence[Row], named: Sequence[Material], told: Sequence[Column], out_dir: Path) -> dict[str, Any]:
    script = (TEMPLATES / "batch.js").read_text(encoding="utf-8")
    colour_of = {one.name: index for index, one in enumerate(named)}
    return {
        "style": STYLE.read_text(encoding="utf-8") + (TEMPLATES / "batch.css").read_text(encoding="utf-8"),
        "script": script,
        "script_hash": base64.b64encode(hashlib.sha256(f"\n{script}\n".encode()).digest()).decode("ascii"),
        "count": len(rows),
        "what": "fit" if any(row.cells["group"] for row in rows) else "photograph",
        "failed": [row for row in rows if row.cells["status"] == "failed"],
        "materials": [material_section(one, rows, index) for index, one in enumerate(named)],
        "far": sum(bool(row.cells.get("outlier")) for row in rows),
        "plot": gloss_plot(rows, colour_of),
        "legend": [(name, index % COLOURS) for name, index in colour_of.items()],
        "swatches": [
            (index, row.cells["photograph"], swatch(row), bool(row.cells.get("outlier")))
            for index, row in enumerate(rows)
            if swatch(row)
        ],
        "choices": {name: _choices(rows, name) for name in ("status", "material", "model")},
        "flags": _flag_counts(rows),
        "relative": any(row.cells.get("scale") == "relative" for row in rows),
        "rows": photograph_rows(rows, out_dir, colour_of),
        "columns": told,
        "pooled_columns": POOLED,
    }


def _choices(rows: Sequence[Row], name: str) -> list[str]:
    return sorted({str(row.cells.get(name)) for row in rows if row.cells.get(name)})


def _flag_counts(rows: Sequence[Row]) -> list[tuple[str, str, int]]:
    """Flag, meaning and on how many photographs, the most frequent first."""
    counted = Counter(flag for row in rows for flag in str(row.cells.get("flags") or "").split())
    meaning = {str(flag): text for flag, text in MEANING.items()}
    ordered = sorted(counted.items(), key=lambda item: (-item[1], item[0]))
    return [(flag, meaning.get(flag, ""), times) for flag, times in ordered]
