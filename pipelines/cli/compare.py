"""`fit-material compare`: what changed between two results or two batches."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.batch.compare import Change, Comparison

MOST = 200  # lines of each kind; --json has all
CHANGED = 1


def compare(
    a: Annotated[Path, Parameter(help="STEM.json, its folder, or the folder of a batch.")],
    b: Annotated[Path, Parameter(help="The same of what it is compared with.")],
    /,
    *,
    json: Annotated[bool, Parameter(help="Print one JSON object, every number in it.")] = False,
    strict: Annotated[bool, Parameter(help="Exit 1 where a number changed beyond its uncertainty.")] = False,
    debug: Annotated[bool, Parameter(help="Show the traceback of an error.")] = False,
) -> int:
    """Tell what changed from A to B beyond its uncertainty; results of batches are paired by their places.

    Example: fit-material compare monday.fits friday.fits
    """
    from pipelines.batch.compare import compare as side_by_side
    from pipelines.batch.held import hold

    terminal = Terminal(json=json, debug=debug)
    found = side_by_side(hold(a), hold(b))
    if json:
        terminal.object(_object(found))
    else:
        terminal.result("\n".join(_lines(found)) + "\n")
    return CHANGED if strict and found.changed else 0


def _object(found: Comparison) -> dict[str, object]:
    from dataclasses import asdict

    from pipelines.report.result import finite

    told = {
        "schema": "fit-material/compare/1",
        "photographs": found.pairs,
        "same_photographs": found.same_photographs,
        "changed": len(found.changed),
        "numbers": [asdict(one) for one in found.numbers],
        "remarks": [{"where": where, "remark": remark} for where, remark in found.remarks],
    }
    return {key: finite(value) for key, value in told.items()}


def _lines(found: Comparison) -> Iterator[str]:
    same = f", {found.same_photographs} of them the very same file" if found.same_photographs else ""
    yield f"{found.pairs} photograph{'' if found.pairs == 1 else 's'} in both{same}"
    changed = found.changed
    yield f"changed beyond uncertainty: {len(changed)} of {len(found.numbers)} numbers (5 % for any false one, Holm)"
    yield from _cut([_line(one) for one in changed])
    if found.remarks:
        yield "besides:"
        yield from _cut([f"  {where}: {remark}" for where, remark in found.remarks])


def _cut(lines: list[str]) -> list[str]:
    return lines if len(lines) <= MOST else [*lines[:MOST], f"  ... and {len(lines) - MOST} more: --json has them"]


def _line(one: Change) -> str:
    from pipelines.report.numbers import digits, measured

    before = f"{measured(one.before, one.before_sd)} ± {digits(one.before_sd, 2)}"
    after = f"{measured(one.after, one.after_sd)} ± {digits(one.after_sd, 2)}"
    by = digits(one.after - one.before, 2)
    return f"  {one.where}: {one.what} {before} -> {after}, {by} or {abs(one.z):.1f} sd ({one.lobes})"
