"""The application: its commands, and `main`, which turns every outcome into an exit code and one line."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Annotated, Literal, NoReturn

from cyclopts import App, CycloptsError, Parameter

from pipelines.memory import keep_memory
from toolkit import __version__
from toolkit.errors import FitMaterialError, UsageError

from .batch import batch
from .compare import compare
from .doctor import doctor
from .fit import fit
from .help import Columns
from .light import light
from .models import models
from .plan import plan
from .render import render
from .terminal import Terminal, open_closed_streams
from .validate import validate

HELP = """Estimate what a surface is made of, optically, from a photograph of a sphere.

Give raw photographs (DNG and others), or linear EXR, 16-bit PNG, TIFF or Radiance .hdr. Results go to stdout, all
else to stderr. Exit codes: 0 good, 1 a fit failed, 2 usage, 3 bad input, 4 several images and some failed,
5 low quality with --strict, 130 interrupted, 143 terminated.
"""

app = App(
    name="fit-material",
    help=HELP,
    usage="Usage: fit-material IMAGE [IMAGE ...] [OPTIONS]\n       fit-material COMMAND ...",
    version=__version__,
    help_format="plaintext",
    help_formatter=Columns(),
    default_parameter=Parameter(negative="", show_default=False),
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)
app.default(fit)
app.command(batch, name="batch", usage="Usage: fit-material batch INPUT ... --out DIR [OPTIONS]")
app.command(compare, name="compare")
app.command(doctor, name="doctor", usage="Usage: fit-material doctor IMAGE [OPTIONS]")
app.command(light, name="light", usage="Usage: fit-material light IMAGE [IMAGE ...] [OPTIONS]")
app.command(render, name="render")
app.command(models, name="models")
app.command(plan, name="plan")
app.command(validate, name="validate")


@app.command(name="--completion")
def completion(shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="The shell.")], /) -> int:
    """Print a completion script for a shell: bash, zsh or fish."""
    Terminal().result(app.generate_completion(shell=shell))
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code. `argv` are the words after the program's name."""
    open_closed_streams()
    if argv is None:  # this process is the program's own
        keep_memory()
        signal.signal(signal.SIGTERM, _terminated)
    words = list(sys.argv[1:] if argv is None else argv)
    terminal = Terminal(json="--json" in words or "--jsonl" in words, debug="--debug" in words)
    try:
        code = _run(words, terminal)
    except KeyboardInterrupt:
        terminal.error("interrupted")
        code = 130
    return terminal.close(code)


def _terminated(number: int, _: FrameType | None) -> NoReturn:
    """End as on an interrupt: forks with this process, no draft left behind."""
    raise SystemExit(128 + number)


def _run(words: list[str], terminal: Terminal) -> int:
    try:
        if not words:
            raise UsageError("found no image; expected fit-material IMAGE [IMAGE ...]; --help tells more")
        result = app(words)
    except CycloptsError as error:
        text = " ".join(str(error).split()).rstrip(".")
        return terminal.failure("", UsageError(f"{text}; expected what fit-material --help shows"))
    except FitMaterialError as error:
        return terminal.failure("", error)
    except Exception as error:  # the last resort: a defect must not look like a crash
        return terminal.failure("", error)
    return result if isinstance(result, int) else 0
