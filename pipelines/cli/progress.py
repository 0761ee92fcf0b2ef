"""A batch watched: a bar with the time to go on a terminal, a line for each photograph with --verbose."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from .terminal import Terminal


@dataclass(slots=True, kw_only=True)
class Watch:
    """Told of each photograph as it ends."""

    total: int
    terminal: Terminal
    advance: Callable[[int, str], None]
    begin: float = field(default_factory=time.monotonic)
    done: int = 0
    made: int = 0

    def ended(self, name: str, status: str, error: str) -> None:
        """One more: failures are told at once, others with --verbose."""
        self.done += 1
        self.made += status != "kept"
        if status == "failed":
            own = name.rpartition("/")[2]  # an error may begin with the file's name, which says less
            self.terminal.error(f"{name}: {error.removeprefix(f'{own}: ')}")
        else:
            self.terminal.note(f"[{self.done}/{self.total}] {name}: {status}{self.to_go()}")
        self.advance(self.done, name)

    def note(self, text: str) -> None:
        """Something odd that a user should know of."""
        self.terminal.error(text)

    def to_go(self) -> str:
        """The time to go, from what was made so far; results kept from an earlier run cost nothing."""
        if not self.made or self.done == self.total:
            return ""
        left = (time.monotonic() - self.begin) / self.made * (self.total - self.done)
        return f", about {duration(left)} to go"


def duration(seconds: float) -> str:
    """As people say it: 40 s, 12 min, 3 h 20 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


@contextmanager
def watching(total: int, terminal: Terminal) -> Iterator[Watch]:
    """A watch over `total` photographs."""
    if terminal.quiet or not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield Watch(total=total, terminal=terminal, advance=lambda done, name: None)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    text = TextColumn("{task.description}", markup=False)
    with Progress(MofNCompleteColumn(), BarColumn(), text, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)
        watch = Watch(total=total, terminal=terminal, advance=lambda done, name: None)

        def advance(done: int, name: str) -> None:
            bar.update(task, completed=done, description=f"{name[-40:]}{watch.to_go()}")

        watch.advance = advance
        yield watch
