"""batch.html: the whole batch on one page that needs nothing else; it reads without scripts, and sorts with one."""

from __future__ import annotations

import base64
import hashlib
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pipelines.report.numbers import digits, measured, percent
from toolkit.flags import MEANING

from .card import read_card
from .columns import POOLED, Column
from .materials import Material, Parameter
from .plots import gloss_plot, strip_plot
from .rows import CHANNELS, Row

TEMPLATES = Path(__file__).parent / "templates"
STYLE = Path(__file__).parents[1] / "report" / "templates" / "style.css"
STRIP = re.compile(r"data:image/webp;base64,[A-Za-z0-9+/=]{1,100000}")
SWATCH = re.compile(r"#[0-9a-fA-F]{6}")
PLOTTED = 4  # strips drawn of a material: its shape, its highlight, its green
SHAPES = ("alpha", "roughness_rad", "shininess")
STRENGTHS = ("specular_strength", "specular_albedo")


def write_page(
    path: Path, rows: Sequence[Row], named: Sequence[Material], told: Sequence[Column], *, out_dir: Path
) -> None:
    """Write the page, row by row: the pictures of a thousand photographs are never held together."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    context = _context(rows, named, told, out_dir)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        for piece in environment.get_template("batch.html.j2").generate(context):
            stream.write(piece)


def _context(rows: Sequence[Row], named: Sequence[Material], told: Sequence[Column], out_dir: Path) -> dict[str, Any]:
    script = (TEMPLATES / "batch.js").read_text(encoding="utf-8")
    colour_of = {one.name: index for index, one in enumerate(named)}
    failed = [row for row in rows if row.cells["status"] == "failed"]
    return {
        "style": STYLE.read_text(encoding="utf-8") + (TEMPLATES / "batch.css").read_text(encoding="utf-8"),
        "script": script,
        "script_hash": base64.b64encode(hashlib.sha256(f"\n{script}\n".encode()).digest()).decode("ascii"),
        "count": len(rows),
        "failed": failed,
        "materials": [_material(one, rows, index) for index, one in enumerate(named)],
        "far": sum(bool(row.cells.get("outlier")) for row in rows),
        "plot": gloss_plot(rows, colour_of),
        "legend": [(name, index % 8) for name, index in colour_of.items()],
        "swatches": [
            (index, row.cells["photograph"], row.cells["swatch"], bool(row.cells.get("outlier")))
            for index, row in enumerate(rows)
            if _is_swatch(row.cells.get("swatch"))
        ],
        "choices": {name: _choices(rows, name) for name in ("status", "material", "model")},
        "flags": _flag_counts(rows),
        "relative": any(row.cells.get("scale") == "relative" for row in rows),
        "rows": (_shown(index, row, out_dir, colour_of) for index, row in enumerate(rows)),
        "columns": told,
        "pooled_columns": POOLED,
    }


def _is_swatch(value: object) -> bool:
    return isinstance(value, str) and SWATCH.fullmatch(value) is not None


def _choices(rows: Sequence[Row], name: str) -> list[str]:
    return sorted({str(row.cells.get(name)) for row in rows if row.cells.get(name)})


def _flag_counts(rows: Sequence[Row]) -> list[tuple[str, str, int]]:
    """Flag, meaning and on how many photographs, the most frequent first."""
    counted = Counter(flag for row in rows for flag in str(row.cells.get("flags") or "").split())
    meaning = {str(flag): text for flag, text in MEANING.items()}
    return [
        (flag, meaning.get(flag, ""), times) for flag, times in sorted(counted.items(), key=lambda i: (-i[1], i[0]))
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """What a cell shows, and what it is sorted by."""

    text: str
    small: str
    sort: str


def _shown(index: int, row: Row, out_dir: Path, colour_of: dict[str, int]) -> dict[str, Any]:
    """One row of the page's table."""
    cells = row.cells
    strip = read_card(out_dir / row.card).get("strip") if row.card else None
    swatch = cells.get("swatch")
    return {
        "id": f"p{index}",
        "cells": cells,
        "href": quote(row.page) if row.page else "",
        "strip": strip if isinstance(strip, str) and STRIP.fullmatch(strip) else "",
        "swatch": swatch if _is_swatch(swatch) else "",
        "colour": colour_of.get(str(cells["material"]), 0) % 8,
        "model": str(cells.get("model") or ""),
        "lobes": " over ".join(filter(None, (str(cells.get("model") or ""), str(cells.get("diffuse") or "")))),
        "shape": _shape(row),
        "albedo": _colour_cell(row, "diffuse_albedo"),
        "strength": next((c for name in STRENGTHS if (c := _colour_cell(row, name)).text), NOTHING),
        "chi2": Cell(text=_text(row, "chi2_reduced", 3), small="", sort=_sort(row.cells.get("chi2_reduced"))),
        "flags": str(cells.get("flags") or "").split(),
    }


NOTHING = Cell(text="", small="", sort="")


def _shape(row: Row) -> Cell:
    """The highlight's width in the best model's own number; sorted by the common one."""
    name = next((name for name in SHAPES if _number(row, name) is not None), None)
    if name is None:
        return NOTHING
    value, sd = _number(row, name), _number(row, f"{name}_sd")
    low, high = (_number(row, f"{name}_{end}90") for end in ("low", "high"))
    label, unit = name.removesuffix("_rad"), " rad" if name.endswith("_rad") else ""
    text = f"{label} {measured(value, sd)}{'' if sd is None else f' ± {digits(sd, 2)}'}{unit}"
    small = f"90 %: {measured(low, sd)} to {measured(high, sd)}" if low is not None and high is not None else ""
    return Cell(text=text, small=small, sort=_sort(row.cells.get("alpha_ggx")))


def _colour_cell(row: Row, name: str) -> Cell:
    """Three numbers with the digits that their sds allow; sorted by their mean."""
    values = [_number(row, f"{name}_{channel}") for channel in CHANNELS]
    sds = [_number(row, f"{name}_{channel}_sd") for channel in CHANNELS]
    if all(value is None for value in values):
        value, sd = _number(row, name), _number(row, f"{name}_sd")
        if value is None:
            return NOTHING
        return Cell(text=measured(value, sd), small=f"± {digits(sd, 2)}", sort=_sort(value))
    known = [value for value in values if value is not None]
    return Cell(
        text="  ".join(measured(value, sd) for value, sd in zip(values, sds, strict=True)),
        small="± " + "  ".join(digits(sd, 2) for sd in sds),
        sort=_sort(sum(known) / len(known)),
    )


def _number(row: Row, name: str) -> float | None:
    value = row.cells.get(name)
    return float(value) if isinstance(value, float | int) and not isinstance(value, bool) else None


def _text(row: Row, name: str, count: int) -> str:
    value = _number(row, name)
    return "" if value is None else digits(value, count)


def _sort(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float | int) else ""


def _material(one: Material, rows: Sequence[Row], index: int) -> dict[str, Any]:
    """A material's section: a sentence, a table, and strips of what matters most."""
    headline = next((p for name in SHAPES for p in one.parameters if p.name == name and p.pooled), None)
    return {
        "name": one.name,
        "colour": index % 8,
        "fitted": len(one.rows),
        "photographs": one.photographs,
        "lobes": " over ".join(filter(None, (one.lobes[0], one.lobes[2]))) if one.lobes else "",
        "variant": one.lobes[1] if one.lobes else "",
        "relative": one.relative,
        "headline": _headline(headline) if headline else None,
        "rows": list(_pooled_rows(one)),
        "plots": [(_title(p), plot) for p in _plotted(one) if (plot := strip_plot(p, rows, index)) is not None],
        "outliers": [(row, rows[row].cells["photograph"]) for row in sorted(one.outliers)],
    }


def _plotted(one: Material) -> list[Parameter]:
    """The shape, then the strength and the albedo in green."""
    wanted = [(name, "") for name in SHAPES] + [(name, "g") for name in (*STRENGTHS, "diffuse_albedo")]
    found = [p for name, channel in wanted for p in one.parameters if p.name == name and p.channel in (channel, "")]
    return found[:PLOTTED]


def _title(parameter: Parameter) -> str:
    name = parameter.name.removesuffix("_rad").replace("_", " ").replace("f0", "F0")
    channel = {"": "", "r": ", red", "g": ", green", "b": ", blue"}[parameter.channel]
    return f"{name}{channel}{f', {parameter.unit}' if parameter.unit else ''}"


def _headline(parameter: Parameter) -> dict[str, str]:
    found = parameter.pooled
    assert found is not None  # noqa: S101  # chosen so
    return {
        "name": _title(parameter),
        "mean": f"{measured(found.mean, found.sd)} ± {digits(found.sd, 2)}",
        "scatter": digits(found.scatter, 2),
        "error": "" if found.scatter_sd is None else digits(found.scatter_sd, 1),
        "low": digits(found.scatter_low, 2),
        "high": digits(found.scatter_high, 2),
        "share": percent(found.scatter / abs(found.mean)) if found.mean else "",
        "own": digits(found.typical_sd, 2),
        "expect": ""
        if found.expect_low is None
        else f"{measured(max(found.expect_low, 0.0), found.scatter or found.sd)} to "
        f"{measured(found.expect_high, found.scatter or found.sd)}",
    }


def _pooled_rows(one: Material) -> Iterator[dict[str, Any]]:
    for parameter in one.parameters:
        found = parameter.pooled
        yield {
            "title": _title(parameter).partition(",")[0],
            "channel": parameter.channel.upper(),
            "unit": parameter.unit,
            "count": len(parameter.members),
            "told": found is not None,
            "mean": measured(found.mean, found.sd) if found else "",
            "sd": digits(found.sd, 2) if found else "",
            "interval": f"{measured(found.low, found.sd)} to {measured(found.high, found.sd)}" if found else "",
            "scatter": digits(found.scatter, 2) if found else "",
            "scatter_sd": digits(found.scatter_sd, 1) if found else "",
            "scatter_interval": f"{digits(found.scatter_low, 2)} to {digits(found.scatter_high, 2)}" if found else "",
            "share": percent(found.scatter / abs(found.mean)) if found and found.mean else "",
            "own": digits(found.typical_sd, 2) if found else "",
            "i2": percent(found.i2) if found else "",
            "outliers": sum(member.outlier for member in parameter.members),
        }
