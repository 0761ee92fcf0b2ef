"""Comments for XML that nothing in them can leave."""

from __future__ import annotations

import re


def comment(*lines: str) -> str:
    """An XML comment of these lines; two hyphens in a row, which would end it, become one."""
    safe = [re.sub(r"-(?=-)|[^\x20-\x7e]", "", line).rstrip("-") for line in lines]
    return "<!-- " + "\n     ".join(safe) + " -->\n"
