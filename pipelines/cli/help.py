"""Help as plain columns: the same text on a terminal, in a pipe and in the documentation."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console, ConsoleOptions

COLUMN = 22  # where descriptions begin
WIDEST = 100


class Columns:
    """A cyclopts help formatter: names at the left, descriptions in one column beside or below them."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """One section; nothing for one without entries."""
        if panel.entries:
            width = min(console.width, WIDEST)
            lines = [line for entry in panel.entries for line in _entry(entry, console, options, width)]
            _print(console, "\n".join([f"{_plain(panel.title, console, options)}:", *lines, ""]))

    def render_usage(self, console: Console, options: ConsoleOptions, usage: object) -> None:
        """The usage lines, as they are."""
        text = str(usage).strip()
        if text:
            _print(console, f"{'' if text.startswith('Usage:') else 'Usage: '}{text}\n")

    def render_description(self, console: Console, options: ConsoleOptions, description: object) -> None:
        """Paragraphs."""
        text = _plain(description, console, options)
        if text:
            width = min(console.width, WIDEST)
            paragraphs = [textwrap.fill(" ".join(part.split()), width) for part in text.split("\n\n")]
            _print(console, "\n\n".join(paragraphs) + "\n")


def _entry(entry: HelpEntry, console: Console, options: ConsoleOptions, width: int) -> list[str]:
    names = ", ".join(dict.fromkeys(entry.display_labels_with_metavar))
    choices = f"[choices: {', '.join(entry.choices)}]" if entry.choices else ""
    description, default, given = _plain(entry.description, console, options).partition("[default:")
    words = f"{description} {choices} {default}{given}{' [required]' if entry.required else ''}".split()
    text = textwrap.wrap(" ".join(words), width - COLUMN, break_on_hyphens=False) or [""]
    beside = len(names) + 4 <= COLUMN
    head = f"  {names:{COLUMN - 2}}{text[0]}" if beside else f"  {names}"
    return [head.rstrip(), *(" " * COLUMN + line for line in (text[1:] if beside else text))]


def _plain(renderable: object, console: Console, options: ConsoleOptions) -> str:
    """What rich would show, without its styles and without its line breaks."""
    if renderable is None or isinstance(renderable, str):
        return renderable or ""
    wide = options.update(width=100_000)
    text = "".join(part.text for part in console.render(renderable, wide))  # type: ignore[arg-type]  # cyclopts hands on what rich renders
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def _print(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
