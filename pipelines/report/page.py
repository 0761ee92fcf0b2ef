"""STEM.html: the whole result as one page that needs nothing else. No script, no request; it reads, and it prints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.flags import Flag
from toolkit.records import MaterialReport

from . import dictionary
from .template import STYLE, template
from .text import base_name, stem

if TYPE_CHECKING:
    from pipelines.settings import Settings

TEMPLATES = Path(__file__).parent / "templates"
SERIOUS = {
    Flag.POOR_FIT,
    Flag.NOT_CONVERGED,
    Flag.NOT_IDENTIFIED,
    Flag.HIGHLIGHT_CLIPPED,
    Flag.HIGHLIGHT_UNSEEN,
    Flag.SPHERE_UNCERTAIN,
}  # flags that put the numbers themselves in doubt


def page_text(report: MaterialReport, settings: Settings | None = None) -> str:
    """The page as HTML. The same report gives the same bytes."""
    return template(TEMPLATES / "page.html.j2").render(_context(report, settings))


def _context(report: MaterialReport, settings: Settings | None) -> dict[str, Any]:
    from pipelines.export.material import material_of

    from . import provenance, rows
    from .answer import answer

    material = material_of(report)
    return {
        "name": " + ".join(base_name(one.image.name) for one in report.photographs or [report]),
        "stem": stem(report.image.name),
        "style": STYLE.read_text(encoding="utf-8"),
        "answer": answer(report, material),
        "notes": material.notes,
        "flags": rows.flag_rows(report),
        "serious": SERIOUS,
        "best": report.fits[report.best],
        "parameters": rows.parameter_rows(report, report.fits[report.best]),
        "models": rows.model_rows(report),
        "others": [(row, rows.parameter_rows(report, report.fits[row.index])) for row in rows.model_rows(report)[1:]],
        "meaning": rows.meaning,
        "separation": report.separation,
        "agreement": report.agreement,
        "settings": _settings_text(settings),
        "dictionary": dictionary,
        "file_rows": provenance.file_rows(report),
        "scene_rows": provenance.scene_rows(report),
        "sampling_rows": provenance.sampling_rows(report),
        "software_rows": provenance.software_rows(),
        **_figures(report),
    }


def _figures(report: MaterialReport) -> dict[str, Any]:
    """The pictures, and each figure as ready SVG or None where it cannot be drawn."""
    from .figures.cluster import skewed_t
    from .figures.corner_plot import corner_plot
    from .figures.highlight import highlight
    from .figures.pictures import pictures
    from .figures.profile import whole_ball
    from .figures.shrink import small
    from .figures.tone import tone_of
    from .rows import ranking

    layers, separation = report.layers, report.separation
    shown = small(layers) if layers is not None else None
    tone = tone_of(report, shown.diffuse) if shown is not None else None
    drawn: dict[str, Callable[[], str | None]] = {
        "plane": lambda: whole_ball(report),
        "highlight": lambda: highlight(report, ranking(report)),
        "corner": lambda: corner_plot(report.fits[report.best]),
    }
    if layers is not None and tone is not None and separation is not None:
        drawn["cluster"] = lambda: skewed_t(separation, layers, tone)
    return {
        "pictures": pictures(report, shown, tone) if shown is not None and tone is not None else [],
        "true_colours": tone is not None and tone.in_srgb,
        "cluster": None,
        **{name: _markup(draw()) for name, draw in drawn.items()},
    }


def _markup(text: str | None) -> object:
    """Figures are our own SVG, their texts escaped by matplotlib."""
    from markupsafe import Markup

    return None if text is None else Markup(text)  # noqa: S704  # written by matplotlib, from numbers and lobes' names


def _settings_text(settings: Settings | None) -> str:
    from pipelines.settings import dumps

    return dumps(settings) if settings is not None else ""
