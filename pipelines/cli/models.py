"""`fit-material models`: every registered lobe, what it takes and what it can be asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .terminal import Terminal

if TYPE_CHECKING:
    from toolkit.reflectance.lobe import Lobe
    from toolkit.reflectance.lobe import Parameter as Number


def models(*, json: Annotated[bool, Parameter(help="Print one JSON object.")] = False) -> int:
    """List the lobes that can be fitted, their parameters and variants."""
    from toolkit.reflectance import LOBES

    terminal = Terminal(json=json)
    if json:
        terminal.object({name: _object(lobe) for name, lobe in LOBES.items()})
    else:
        terminal.result("\n".join(line for kind in ("specular", "diffuse") for line in _section(kind, LOBES)) + "\n")
    return 0


def _section(kind: str, lobes: dict[str, Lobe]) -> Iterator[str]:
    yield f"{kind} (--{'model' if kind == 'specular' else kind}):"
    for lobe in lobes.values():
        if lobe.kind == kind:
            yield f"  {lobe.name}  {lobe.title}"
            yield from (f"    {_number(parameter)}" for parameter in lobe.parameters)
            yield from (f"    {option}: {', '.join(c)} (the first by default)" for option, c in lobe.options.items())


def _number(parameter: Number) -> str:
    unit = "" if parameter.unit in ("", "1") else f" {parameter.unit}"
    return f"{parameter.name}: {parameter.meaning}, {parameter.low:g} to {parameter.high:g}{unit}; {parameter.typical}"


def _object(lobe: Lobe) -> dict[str, Any]:
    shown = ("name", "unit", "low", "high", "typical", "meaning")
    return {
        "title": lobe.title,
        "kind": lobe.kind,
        "colour": lobe.colour,
        "parameters": [{key: getattr(parameter, key) for key in shown} for parameter in lobe.parameters],
        "variants": {option: list(choices) for option, choices in lobe.options.items()},
    }
