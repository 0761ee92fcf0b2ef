"""The files that a result depends on: the photograph, and what its settings name beside it; their digests."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .settings import Settings


def card_file(settings: Settings, folder: Path) -> Path | None:
    """The grey card's own photograph; `folder` is the ball's. None where there is no card, or it is in the ball's."""
    table = settings.reference
    return None if table is None or table.file is None else folder / table.file


def chart_file(settings: Settings, folder: Path) -> Path | None:
    """The colour chart's photograph, which may be the ball's; None where no chart is told of."""
    return None if settings.colour.chart is None else folder / settings.colour.chart


def digest_of(path: Path) -> str:
    """SHA-256 of a file; raises OSError where it cannot be read."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def digest_if_any(path: Path | None) -> str | None:
    """SHA-256 of a file that may not be there; a fit says why it cannot be used."""
    try:
        return None if path is None or not path.is_file() else digest_of(path)
    except OSError:
        return None
