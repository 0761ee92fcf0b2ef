"""Text from files and users made harmless: printable, of bounded length, and safe as part of a file's name."""

from __future__ import annotations

import re
import unicodedata

MAX_CHARACTERS = 400
MAX_STEM = 100
MAX_STEM_BYTES = 200  # file systems count bytes, 255 with all suffixes
_DEVICES = re.compile(r"(?i)^(con|prn|aux|nul|com\d|lpt\d)(\..*)?$")  # names that Windows keeps for itself


def clean(text: object) -> str:
    """The text on one line without control, direction and surrogate characters, at most 400 characters long."""
    one_line = re.sub(r"\s+", " ", str(text)).strip()
    kept = "".join(c if _harmless(c) else "\N{REPLACEMENT CHARACTER}" for c in one_line)
    return kept if len(kept) <= MAX_CHARACTERS else kept[: MAX_CHARACTERS - 1] + "…"


def _harmless(character: str) -> bool:
    return unicodedata.category(character) not in {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


def base_name(path: object) -> str:
    """The last part of a path of any system, cleaned."""
    return clean(re.split(r"[/\\]", str(path))[-1])


def stem(name: object) -> str:
    """A file name's stem that stays inside its folder: letters, digits and ``. _ - ( )`` and spaces; never empty.

    `../../etc/passwd.dng` gives `passwd`, `ball.dng` gives `ball`; what else there is becomes an underscore.
    """
    base = re.split(r"[/\\]", str(name))[-1]
    before, dot, suffix = base.rpartition(".")
    kept = re.sub(r"[^\w.()+ -]", "_", before if dot and before and len(suffix) <= 8 else base)
    kept = kept.strip(". ").lstrip("-")[:MAX_STEM]
    kept = kept.encode()[:MAX_STEM_BYTES].decode(errors="ignore").rstrip(". ")
    return f"_{kept}" if not kept or _DEVICES.match(kept) else kept
