"""Figures as SVG that belongs to the page: its own text, its colours, its light or dark scheme."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours drawn with stand for the page's own, which differ between the light and the dark scheme.
INK, FAINT, PAPER = "#010203", "#a0a1a2", "#fdfcfb"
RED, GREEN, BLUE = "#e00101", "#01b002", "#0303e1"
FITS = ("#f10001", "#f10002", "#f10003", "#f10004", "#f10005", "#f10006", "#f10007", "#f10008")
VARIABLES = {
    INK: "--ink",
    FAINT: "--faint",
    PAPER: "--paper",
    RED: "--red",
    GREEN: "--green",
    BLUE: "--blue",
    **{colour: f"--fit-{index}" for index, colour in enumerate(FITS)},
}
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "fit-material",
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "figure.subplot.left": 0.1,
    "figure.subplot.right": 0.99,
    "figure.subplot.bottom": 0.1,
    "figure.subplot.top": 0.94,
    "figure.subplot.hspace": 0.07,
}


@contextmanager
def figure(width_in: float, height_in: float) -> Iterator[Figure]:
    """A matplotlib figure in the page's style, without pyplot and its global state."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):  # type: ignore[arg-type]  # the stubs want each key's name as a literal
        yield Figure(figsize=(width_in, height_in))


def svg(drawn: Figure, *, name: str, label: str) -> str:
    """The figure as one `svg` element that scales with the page; `label` is read to those who cannot see it."""
    from markupsafe import escape

    held = io.StringIO()
    drawn.savefig(held, format="svg", metadata={"Date": None, "Creator": None}, dpi=160)
    text = held.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = _scoped(text, name)
    text = re.sub(r"font: (?:\w+ )*?([\d.]+px)[^;\"]*", r"font-size: \1", text)
    for colour, variable in VARIABLES.items():
        text = text.replace(colour, f"var({variable})")
    box = re.search(r'viewBox="[^"]*"', text)
    opening = f'<svg {box[0] if box else ""} class="figure" role="img" aria-label="{escape(label)}" xmlns:xlink="http://www.w3.org/1999/xlink">'
    return re.sub(r"<svg[^>]*>", lambda _: opening, text, count=1).strip()


def _scoped(text: str, name: str) -> str:
    """Every id with the figure's name before it, so that two figures of one page do not share any."""
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'xlink:href="#', f'xlink:href="#{name}-', text)
    return text.replace("url(#", f"url(#{name}-")
