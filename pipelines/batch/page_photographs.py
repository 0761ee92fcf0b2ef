"""The page's table: a row a photograph, each cell with what it shows and what it is sorted by."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pipelines.report.numbers import digits, measured

from .card import read_card
from .plots import COLOURS
from .rows import CHANNELS, Row

STRIP = re.compile(r"data:image/webp;base64,[A-Za-z0-9+/=]{1,100000}")
SWATCH = re.compile(r"#[0-9a-fA-F]{6}")
SHAPES = ("alpha", "roughness_rad", "shininess")
STRENGTHS = ("specular_strength", "specular_albedo")


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Numbers side by side, each with a smaller text below it, and what the cell is sorted by."""

    parts: tuple[tuple[str, str], ...]
    sort: str


NOTHING = Cell(parts=(), sort="")


def photograph_rows(rows: Sequence[Row], out_dir: Path, colour_of: dict[str, int]) -> Iterator[dict[str, Any]]:
    """One row after another: the pictures of a thousand photographs are never held together."""
    for index, row in enumerate(rows):
        cells = row.cells
        model, diffuse = str(cells.get("model") or ""), str(cells.get("diffuse") or "")
        yield {
            "id": f"p{index}",
            "cells": cells,
            "href": quote(row.page) if row.page else "",
            "strip": _strip(row, out_dir),
            "swatch": swatch(row),
            "colour": colour_of.get(str(cells["material"]), 0) % COLOURS,
            "model": model,
            "diffuse": diffuse,
            "lobes": f"{model} over {diffuse}" if model else "",
            "shape": _shape(row),
            "albedo": _colour(row, "diffuse_albedo"),
            "strength": next((cell for name in STRENGTHS if (cell := _colour(row, name)).parts), NOTHING),
            "chi2": _plain(row, "chi2_reduced"),
            "flags": str(cells.get("flags") or "").split(),
        }


def swatch(row: Row) -> str:
    """The body's colour, `#rrggbb`; empty where there is none."""
    value = row.cells.get("swatch")
    return value if isinstance(value, str) and SWATCH.fullmatch(value) else ""


def _strip(row: Row, out_dir: Path) -> str:
    """The small pictures, from the photograph's card, and only if they are pictures."""
    strip = read_card(out_dir / row.card).get("strip") if row.card else None
    return strip if isinstance(strip, str) and STRIP.fullmatch(strip) else ""


def _shape(row: Row) -> Cell:
    """The highlight's width in the best model's own number; sorted by the common one."""
    name = next((name for name in SHAPES if row.number(name) is not None), None)
    if name is None:
        return NOTHING
    value, sd = row.number(name), row.number(f"{name}_sd")
    low, high = (row.number(f"{name}_{end}90") for end in ("low", "high"))
    label, unit = name.removesuffix("_rad"), " rad" if name.endswith("_rad") else ""
    text = f"{label} {measured(value, sd)}{'' if sd is None else f' ± {digits(sd, 2)}'}{unit}"
    small = f"90 %: {measured(low, sd)} to {measured(high, sd)}" if low is not None and high is not None else ""
    return Cell(parts=((text, small),), sort=_sort(row.number("alpha_ggx")))


def _colour(row: Row, name: str) -> Cell:
    """A number a channel with its sd, or the one there is; sorted by their mean."""
    coloured = [f"{name}_{channel}" for channel in CHANNELS]
    names = coloured if any(row.number(one) is not None for one in coloured) else [name]
    told = [(row.number(one), row.number(f"{one}_sd")) for one in names]
    known = [value for value, _ in told if value is not None]
    if not known:
        return NOTHING
    parts = tuple((measured(value, sd), "" if sd is None else f"±{digits(sd, 2)}") for value, sd in told)
    return Cell(parts=parts, sort=_sort(sum(known) / len(known)))


def _plain(row: Row, name: str) -> Cell:
    value = row.number(name)
    return NOTHING if value is None else Cell(parts=((digits(value, 3), ""),), sort=_sort(value))


def _sort(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
