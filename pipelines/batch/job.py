"""What a worker is asked to do, and what it answers; both travel between processes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pipelines.files import card_file, chart_file, digest_if_any, digest_of
from pipelines.settings import Settings

Status = Literal["done", "kept", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One fit to make: of a photograph, or of several jointly, each with its settings. `out` is the batch's folder,
    `place` the result's below it; `before` what the journal says of this place, None where it says nothing; it and
    whole results count with `resume` only.
    """

    number: int
    asked: tuple[tuple[Path, Settings], ...]
    out: Path
    place: str
    page: bool
    exports: tuple[str, ...]
    version: str
    resume: bool
    before: Mapping[str, Any] | None
    beacon: Path | None  # where a worker says what it is at, for the case that it dies

    @property
    def name(self) -> str:
        """The photographs, for a message."""
        return " + ".join(str(path) for path, _ in self.asked)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How one fit ended. `lasting`: it would fail again; `seconds`, where a result was made, are not of it."""

    number: int
    status: Status
    error: str = ""
    code: int = 0  # what the command line's exit code would be for it alone
    input: str = ""  # SHA-256 of the photograph, or of those of several
    result: str = ""  # SHA-256 of STEM.json
    lasting: bool = False
    seconds: float = 0.0


def settings_digest(
    asked: Sequence[tuple[Path, Settings]],
    *,
    page: bool,
    exports: tuple[str, ...],
    digest: Callable[[Path | None], str | None] = digest_if_any,
) -> str:
    """One digest of all that a result depends on besides its own photographs and the version.

    The grey card's and the colour chart's photographs count with the settings that name them; `digest` may remember.
    """
    told = {
        "settings": [own.model_dump(mode="json") for _, own in asked],
        "beside": [[digest(of(own, path.parent)) for of in (card_file, chart_file)] for path, own in asked],
        "page": page,
        "exports": sorted(exports),
    }
    return hashlib.sha256(json.dumps(told, sort_keys=True, ensure_ascii=True).encode()).hexdigest()


def digest_of_all(paths: Sequence[Path]) -> str:
    """SHA-256 of a file, or of several files' digests."""
    digests = [digest_of(path) for path in paths]
    return digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()
