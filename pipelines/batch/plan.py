"""What is to be fitted, where its result goes, with which settings; or why it cannot be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pipelines.files import digest_if_any
from pipelines.report.text import clean
from pipelines.settings import Settings
from toolkit.errors import BadInputError

from .job import settings_digest
from .photograph import Photograph
from .places import places


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How a batch is run. `settings_for` gives a photograph's settings, or raises."""

    out: Path
    settings_for: Callable[[Photograph], Settings]
    page: bool = True
    exports: tuple[str, ...] = ()
    parquet: bool = False
    resume: bool = False
    overwrite: bool = False
    version: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One fit, of a photograph or of several jointly: its place and each one's settings, or why there are none."""

    photographs: tuple[Photograph, ...]
    place: str
    settings: tuple[Settings, ...]
    digest: str = ""
    error: Exception | None = None


def plan(photographs: Sequence[Photograph], options: Options) -> list[Item]:
    """Settings and place of each fit; raises UsageError for a flag's mistake, which would fail all."""
    together = grouped(photographs)
    found = places([group[0] for group in together])
    digest = cache(digest_if_any)  # one card may serve a thousand photographs
    return [_item(group, str(place), options, digest) for group, place in zip(together, found, strict=True)]


def grouped(photographs: Sequence[Photograph]) -> list[tuple[Photograph, ...]]:
    """Those of one group together, where its first one stands; of no group each alone."""
    groups: dict[object, list[Photograph]] = {}
    for index, one in enumerate(photographs):
        groups.setdefault(one.group or index, []).append(one)
    return [tuple(group) for group in groups.values()]


def _item(
    group: tuple[Photograph, ...], place: str, options: Options, digest_of: Callable[[Path | None], str | None]
) -> Item:
    try:
        settings = tuple(options.settings_for(one) for one in group)
        _refuse_unlike(group, settings)
    except BadInputError as error:
        return Item(photographs=group, place=place, settings=(), error=error)
    asked = [(one.path.absolute(), own) for one, own in zip(group, settings, strict=True)]
    digest = settings_digest(asked, page=options.page, exports=options.exports, digest=digest_of)
    return Item(photographs=group, place=place, settings=settings, digest=digest)


def _refuse_unlike(group: Sequence[Photograph], settings: Sequence[Settings]) -> None:
    """Photographs fitted jointly show one material and are fitted with the same models, by the same rules."""
    named = sorted({clean(one.material) for one in group})
    if len(named) > 1:
        raise BadInputError(f"group {clean(group[0].group)}: found the materials {', '.join(named)}; expected one")
    for one, own in zip(group, settings, strict=True):
        if own.fit != settings[0].fit:
            raise BadInputError(
                f"group {clean(one.group)}: [fit] of {clean(one.path.name)} differs from that of "
                f"{clean(group[0].path.name)}; expected the same for all"
            )
