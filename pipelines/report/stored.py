"""A result read back from its folder, as untrusted as any other file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

MAX_BYTES = 1 << 26


def read_result(path: Path, *, max_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """The object of a STEM.json, or of another file of JSON; empty where there is none that can be read."""
    try:
        if path.stat().st_size > max_bytes:
            return {}
        found = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
