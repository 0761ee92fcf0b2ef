"""`fit-material doctor IMAGE`: what a photograph is good for, and what to change in the next one."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from toolkit.errors import UsageError

from .flags import OUTPUT, RUN, SCENE, FitFlags, SceneFlags, TalkFlags, settings_for
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.doctor.records import Examination

WIDTH = 100
COLUMN = 20


def doctor(
    image: Annotated[str, Parameter(metavar="IMAGE", help="A photograph of a sphere.")],
    /,
    *,
    scene: SceneFlags = SceneFlags(),  # noqa: B008  # frozen
    transfer: Annotated[
        Literal["srgb"] | None, Parameter(group=SCENE, help="Undo this curve in 8-bit or encoded images; marked.")
    ] = None,
    out: Annotated[
        Path | None,
        Parameter(group=OUTPUT, metavar="DIR", help="Folder of page, picture and JSON. [default: ./STEM.doctor/]"),
    ] = None,
    json: Annotated[bool, Parameter(group=OUTPUT, help="Print the examination as one JSON object.")] = False,
    no_report: Annotated[bool, Parameter(group=OUTPUT, help="Write nothing.")] = False,
    overwrite: Annotated[bool, Parameter(group=RUN, help="Replace an examination that is there.")] = False,
    talk: TalkFlags = TalkFlags(),  # noqa: B008  # frozen
) -> int:
    """Examine a photograph before it is fitted: exposure, noise, outline, light, and what to change in the next one.

    Exit code 3 where a fit would stop at it; what could be read is told all the same. Example:
    fit-material doctor ball.dng
    """
    terminal = Terminal(json=json, quiet=talk.quiet, verbose=talk.verbose and not talk.quiet, debug=talk.debug)
    from pipelines.report.text import stem

    folder = out or Path(f"{stem(Path(image).name)}.doctor")
    if not no_report:
        _refuse_existing(folder, Path(image).name, overwrite=overwrite)
    settings = settings_for(Path(image), scene, FitFlags(transfer=transfer))
    from pipelines.doctor.examine import examine

    with terminal.progress(Path(image).name) as progress:
        progress("examine", 0.0)
        found = examine(Path(image), settings)
        page = None
        if not no_report:
            from pipelines.doctor.write import write_examination

            progress("writing", 0.8)
            page = write_examination(found, folder, settings)
    return _tell(found, page, terminal)


def _refuse_existing(folder: Path, name: str, *, overwrite: bool) -> None:
    from pipelines.doctor.write import names_of

    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file; expected a folder: --out DIR")
    there = [one for one in names_of(name) if (folder / one).exists()]
    if there and not overwrite:
        raise UsageError(f"{folder / there[0]} exists; expected a new place: --out DIR, or --overwrite")


def _tell(found: Examination, page: Path | None, terminal: Terminal) -> int:
    if terminal.json:
        from pipelines.doctor.result import as_object

        terminal.object(as_object(found))
    elif not terminal.quiet:
        terminal.result("\n".join(told(found, page)) + "\n")
    if found.error is None:
        return 0
    terminal.error(f"{found.frame.name}: {str(found.error).removeprefix(f'{found.frame.name}: ')}")
    return found.error.exit_code


def told(found: Examination, page: Path | None) -> Iterator[str]:
    """The examination in lines."""
    from pipelines.doctor.rows import file_rows, measured_rows
    from pipelines.doctor.words import verdict
    from pipelines.report.text import clean

    yield f"{clean(found.frame.name)}: {verdict(found)}"
    for term, value in (*file_rows(found.frame), *measured_rows(found)):
        yield from _wrapped(f"  {term:{COLUMN - 2}}", value)
    if found.advice:
        yield "What to change:"
        for one in found.advice:
            yield from _wrapped("  ! " if one.serious else "  - ", f"{one.do}.", 4)
            yield from _wrapped("    ", one.because, 4)
    if page is not None:
        yield f"page: {clean(page)}"


def _wrapped(head: str, text: str, indent: int = COLUMN) -> list[str]:
    return textwrap.wrap(
        text, WIDTH, initial_indent=head, subsequent_indent=" " * indent, break_on_hyphens=False, break_long_words=False
    ) or [head.rstrip()]
