"""The `console` blocks of a document: commands after `$ `, what they print below."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SKIPPED = "..."  # a line that stands for any number of lines
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")


@dataclass(frozen=True)
class Command:
    """One command and the lines that the document shows below it; none: it shows nothing of them."""

    words: str
    shown: tuple[str, ...]


def blocks(document: Path) -> list[list[Command]]:
    """The document's `console` blocks that run fit-material."""
    text = document.read_text(encoding="utf-8")
    found = [_commands(block) for block in re.findall(r"^```console\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]
    return [block for block in found if any(command.words.startswith("fit-material") for command in block)]


def _commands(block: str) -> list[Command]:
    parts = re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    return [Command(words=lines[0], shown=tuple(lines[1:])) for part in parts if (lines := part.splitlines())]


def agree(shown: tuple[str, ...], printed: str) -> bool:
    """Whether the document shows what was printed; numbers may differ, and `...` stands for any lines."""
    pieces, here = [], 0
    for line in shown:
        if line == SKIPPED:
            pieces.append([])
        else:
            pieces = pieces or [[]]
            pieces[-1].append(_words(line))
    lines = [_words(line) for line in printed.strip().splitlines()]
    for piece in pieces:
        starts = (i for i in range(here, len(lines) - len(piece) + 1) if lines[i : i + len(piece)] == piece)
        start = next(starts, None)
        if start is None:
            return False
        here = start + len(piece)
    opened = not shown or shown[0] == SKIPPED or lines[: len(pieces[0])] == pieces[0]
    closed = not shown or not pieces[-1] or here == len(lines)
    return opened and closed


def _words(line: str) -> str:
    return " ".join(_NUMBER.sub("#", line.replace("─", "")).split())
