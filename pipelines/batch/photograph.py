"""One photograph of a batch, as its user names it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toolkit.io.kinds import RAW_SUFFIXES

OTHERS = frozenset([".exr", ".hdr", ".png", ".tif", ".tiff", ".tga", ".jpg", ".jpeg", ".bmp", ".ppm"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """`path` is where it is, `under` where its result goes: parts of a path that the user's own names gave.

    `settings` are over its sidecar and the scene file; `material` names what it shows, `group` what is fitted jointly.
    """

    path: Path
    under: tuple[str, ...]
    material: str = ""
    group: str = ""
    scene: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)


def is_photograph(path: Path) -> bool:
    """Whether a file in a folder is taken for a photograph: by its suffix."""
    return path.suffix.lower() in RAW_SUFFIXES | OTHERS
