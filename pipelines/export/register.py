"""What an exporter says of itself, and the register that `--export` and the documentation read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from toolkit.errors import UsageError

from .material import Material


@dataclass(frozen=True, slots=True, kw_only=True)
class Exporter:
    """One format: `text(material)` is the file's content, STEM + `suffix` its name."""

    name: str
    title: str
    suffix: str
    text: Callable[[Material], str]


EXPORTERS: dict[str, Exporter] = {}


def register(one: Exporter) -> Exporter:
    """Add an exporter; its file is imported by `pipelines.export`. Raises ValueError on a name or suffix taken."""
    if one.name in EXPORTERS or one.suffix in {other.suffix for other in EXPORTERS.values()}:
        raise ValueError(f"an exporter named {one.name!r} or writing {one.suffix!r} exists already")
    EXPORTERS[one.name] = one
    return one


def exporter(name: str) -> Exporter:
    """Look an exporter up by name; raises UsageError on one that does not exist."""
    if name not in EXPORTERS:
        raise UsageError(f"--export {name[:40]!r} is no known format; expected one of {', '.join(EXPORTERS)}")
    return EXPORTERS[name]
