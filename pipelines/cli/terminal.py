"""Where text goes: results to stdout, all else to stderr, failures in one line, progress only on a terminal."""

from __future__ import annotations

import io
import json as json_module
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipelines.told import in_one_line
from toolkit.errors import FitMaterialError

if TYPE_CHECKING:
    from rich.console import Console

Progress = Callable[[str, float], None]


@dataclass(frozen=True, kw_only=True)
class Terminal:
    """How one command talks."""

    json: bool = False
    quiet: bool = False
    verbose: bool = False
    debug: bool = False

    def result(self, text: str) -> None:
        """A result on stdout; a reader who has gone away (`| head`) does not stop the work."""
        encoding = sys.stdout.encoding or "utf-8"
        try:
            sys.stdout.write(text.encode(encoding, "replace").decode(encoding))
            sys.stdout.flush()
        except BrokenPipeError:
            _discard_stdout()

    def object(self, values: Mapping[str, Any], *, lines: bool = False) -> None:
        """One JSON object on stdout; with `lines` on one line."""
        from pipelines.report.result import result_text

        text = result_text(values, indent=None if lines else 1)
        narrow = (sys.stdout.encoding or "utf-8").lower().replace("-", "") != "utf8"
        self.result(json_module.dumps(json_module.loads(text)) + "\n" if narrow and not text.isascii() else text)

    def note(self, text: str) -> None:
        """A remark on stderr with --verbose."""
        if self.verbose:
            _stderr(text)

    def say(self, text: str) -> None:
        """A line on stderr that is no error."""
        from pipelines.report.text import clean

        _stderr(clean(text))

    def error(self, text: str) -> None:
        """One line on stderr, whatever the text holds."""
        from pipelines.report.text import clean

        _stderr(f"fit-material: {clean(text)}")

    def failure(self, name: str, error: Exception, *, lines: bool = False) -> int:
        """Tell of a failure on stderr, and as an object on stdout where JSON is wanted; returns its exit code."""
        text = in_one_line(error)
        if self.debug:
            _stderr("".join(traceback.format_exception(error)).rstrip())
        said = text.removeprefix(f"{os.path.basename(name)}: ")  # noqa: PTH119  # pathlib would be this module's only use
        self.error(f"{name}: {said}" if name and not text.startswith(f"{name} ") else text)
        if self.json:
            from pipelines.report.result import failure_object

            self.object(failure_object(name, text), lines=lines)
        return error.exit_code if isinstance(error, FitMaterialError) else 1

    def show(self, print_to: Callable[[Console], None]) -> None:
        """What `print_to` prints, on stdout: plain without a terminal, without colour under NO_COLOR."""
        from rich.console import Console

        text = io.StringIO()
        print_to(Console(file=text, force_terminal=sys.stdout.isatty(), highlight=False))
        self.result(text.getvalue())

    @contextmanager
    def progress(self, name: str) -> Iterator[Progress]:
        """A bar on stderr that follows (stage, share done); without a terminal only --verbose tells of stages."""
        if self.quiet or not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
            yield self._stages(name)
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(name, total=1.0)
            yield lambda stage, share: bar.update(task, description=f"{name}: {stage}", completed=share)

    def _stages(self, name: str) -> Progress:
        told: list[str] = []

        def tell(stage: str, share: float) -> None:
            if told[-1:] != [stage]:
                told.append(stage)
                self.note(f"{name}: {stage}")

        return tell

    def close(self, code: int) -> int:
        """Flush stdout; a result that could not be written (a full disk) is a failure."""
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            _discard_stdout()
        except OSError as error:
            self.error(f"stdout cannot be written: {error.strerror}; expected a place with room for the result")
            _discard_stdout()
            return code or 1
        return code


def open_closed_streams() -> None:
    """A standard stream that was closed (`>&-`) goes nowhere, and no file that is opened later takes its number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
            if handle != number:
                os.dup2(handle, number)
                os.close(handle)
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115  # lives as long as the process


def _stderr(text: str) -> None:
    try:
        sys.stderr.write(text + "\n")
        sys.stderr.flush()
    except OSError:
        pass  # nobody listens


def _discard_stdout() -> None:
    """What is still to be written, also by the interpreter at its end, goes nowhere."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(devnull, sys.stdout.fileno())
    except (OSError, ValueError):
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115, PTH123  # lives as long as the process
    finally:
        os.close(devnull)
