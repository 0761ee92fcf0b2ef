"""validation.html: what was rendered, what came back, and whether to believe it. One file, no script, no request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipelines.report.template import STYLE, template
from toolkit import __version__
from toolkit.flags import MEANING, Flag

from .broken import ASSUMPTIONS
from .figures import model_plot, rank_plots, z_plots
from .ranks import LEVELS
from .score import MISS_SDS, Score, model_of
from .stress import ALARMS, worst_of
from .verdict import complaints, least_p, verdict

TEMPLATES = Path(__file__).parent / "templates"


def page_text(found: Score, lines: Sequence[Mapping[str, Any]], *, title: str, told: str, promise: str = "") -> str:
    """The page as HTML; `told` says in words what was rendered, `promise` what a user may expect of their set-up."""
    from markupsafe import Markup

    designed = any(line["scene"] for line in lines)
    drawn = {"ranks": rank_plots(found), "psnr": model_plot(lines)}
    if designed:
        drawn["against"] = z_plots(lines)
    return template(TEMPLATES / "validation.html.j2").render(
        style=STYLE.read_text(encoding="utf-8"),
        title=title,
        told=told,
        promise=promise,
        version=__version__,
        found=found,
        verdict=verdict(found),
        complaints=complaints(found),
        levels=LEVELS,
        least_p=least_p(found),
        pools=(("model, over its parameters", found.models), ("parameter, over its models", found.parameters)),
        miss_sds=MISS_SDS,
        model_of=model_of,
        worst_of=worst_of,
        assumptions=ASSUMPTIONS,
        alarms=sorted(ALARMS),
        meaning={flag: MEANING[Flag(flag)] for flag in ALARMS},
        figures={name: Markup(text) for name, text in drawn.items()},  # noqa: S704  # our own SVG
    )
