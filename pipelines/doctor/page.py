"""STEM.doctor.html: the examination as one page that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

from pipelines.report.text import base_name, clean
from toolkit import __version__
from toolkit.flags import MEANING, Flag

from .histogram import histogram
from .picture import CLIPPED, GLARE, HIGHLIGHT, OUTLINE
from .records import Examination
from .rows import file_rows, measured_rows
from .words import verdict

TEMPLATES = Path(__file__).parent / "templates"
STYLE = Path(__file__).parents[1] / "report" / "templates" / "style.css"


def page_text(found: Examination, pictures: Sequence[bytes]) -> str:
    """The page as HTML, with its pictures (PNG: the frame, the ball) inside. The same input gives the same bytes."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    drawn = histogram(found)
    return environment.get_template("doctor.html.j2").render(
        style=STYLE.read_text(encoding="utf-8"),
        name=base_name(found.frame.name),
        verdict=verdict(found),
        error=None if found.error is None else clean(found.error),
        advice=found.advice,
        pictures=[f"data:image/png;base64,{base64.b64encode(one).decode('ascii')}" for one in pictures],
        ball=found.scene is not None,
        colours={
            "outline": _hex(OUTLINE),
            "highlight": _hex(HIGHLIGHT),
            "clipped": _hex(CLIPPED),
            "glare": _hex(GLARE),
        },
        histogram=None if drawn is None else Markup(drawn),  # noqa: S704  # our own SVG, of numbers alone
        file_rows=file_rows(found.frame),
        measured_rows=measured_rows(found),
        flags=[(flag, MEANING[Flag(flag)]) for flag in found.flags],
        version=__version__,
    )


def _hex(colour: tuple[int, int, int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)
