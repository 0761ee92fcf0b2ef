"""Seconds by stage, told to whoever watches; and what can be done while a stage waits."""

from __future__ import annotations

import importlib
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from .interrupts import interrupts_held

Progress = Callable[[str, float], None]


@dataclass
class Clock:
    """Seconds by stage, told to `progress` as each begins."""

    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what happens inside."""
        if self.progress is not None:
            self.progress(name, 0.0)
        begin = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin


@contextmanager
def imported_meanwhile(*modules: str) -> Iterator[None]:
    """Import modules in the background while a child process decodes: half a second that nobody waits for.

    An interrupt in the midst of an import can leave Python's import lock taken and be lost itself: it waits till then.
    """

    def load() -> None:
        for module in modules:
            importlib.import_module(module)

    thread = threading.Thread(target=load, daemon=True)
    thread.start()
    with interrupts_held():
        yield
        thread.join()
