"""The page's materials: a headline, strips of what matters most, a table of what is pooled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from pipelines.report.numbers import digits, measured, percent

from .materials import Material, Parameter
from .page_photographs import SHAPES, STRENGTHS
from .plots import COLOURS, strip_plot
from .pool import Pooled
from .rows import Row


def material_section(one: Material, rows: Sequence[Row], index: int) -> dict[str, Any]:
    """What the page says of a material; `index` is its place among all, for its colour."""
    headline = next((p for name in SHAPES for p in one.parameters if p.name == name and p.pooled), None)
    model, variant, diffuse = one.lobes or ("", "", "")
    return {
        "name": one.name,
        "colour": index % COLOURS,
        "fitted": len(one.rows),
        "photographs": one.photographs,
        "lobes": f"{model} over {diffuse}{f' ({variant})' if variant else ''}" if one.lobes else "",
        "relative": one.relative,
        "headline": _headline(headline, headline.pooled) if headline and headline.pooled else None,
        "rows": list(_pooled_rows(one)),
        "plots": [(_title(p), plot) for p in _plotted(one) if (plot := strip_plot(p, rows, index)) is not None],
        "outliers": [(row, rows[row].cells["photograph"]) for row in sorted(one.outliers)],
    }


def _plotted(one: Material) -> list[Parameter]:
    """The shape, then the strength and the albedo in green."""
    wanted = [(name, "") for name in SHAPES] + [(name, "g") for name in (*STRENGTHS, "diffuse_albedo")]
    return [p for name, channel in wanted for p in one.parameters if p.name == name and p.channel in (channel, "")]


def _name(parameter: Parameter) -> str:
    return parameter.name.removesuffix("_rad").replace("_", " ").replace("f0", "F0")


def _title(parameter: Parameter) -> str:
    channel = {"": "", "r": ", red", "g": ", green", "b": ", blue"}[parameter.channel]
    return f"{_name(parameter)}{channel}{f', {parameter.unit}' if parameter.unit else ''}"


def _headline(parameter: Parameter, found: Pooled) -> dict[str, str]:
    expect = ""
    if found.expect_low is not None:
        spread = found.scatter or found.sd
        expect = f"{measured(max(found.expect_low, 0.0), spread)} to {measured(found.expect_high, spread)}"
    return {"name": _title(parameter), "expect": expect, **_words(found)}


def _pooled_rows(one: Material) -> Iterator[dict[str, Any]]:
    """A row a parameter and channel; one for all channels where no channel is pooled."""
    for _, group in groupby(one.parameters, key=lambda parameter: parameter.name):
        channels = list(group)
        for parameter in channels if any(p.pooled for p in channels) else channels[:1]:
            found = parameter.pooled
            first = parameter is channels[0]
            yield {
                "name": _name(parameter) if first else "",
                "unit": parameter.unit if first else "",
                "channel": parameter.channel.upper() if found else "",
                "first": first,
                "count": len(parameter.members),
                "outliers": sum(member.outlier for member in parameter.members),
                "told": _words(found) if found else None,
            }


def _words(found: Pooled) -> dict[str, str]:
    """The numbers of a pooled parameter with the digits that their sds allow."""
    return {
        "mean": f"{measured(found.mean, found.sd)} ± {digits(found.sd, 2)}",
        "interval": f"{measured(found.low, found.sd)} to {measured(found.high, found.sd)}",
        "scatter": digits(found.scatter, 2) + ("" if found.scatter_sd is None else f" ± {digits(found.scatter_sd, 1)}"),
        "scatter_interval": f"{digits(found.scatter_low, 2)} to {digits(found.scatter_high, 2)}",
        "share": percent(found.scatter / abs(found.mean)) if found.mean else "",
        "own": digits(found.typical_sd, 2),
        "i2": percent(found.i2),
    }
