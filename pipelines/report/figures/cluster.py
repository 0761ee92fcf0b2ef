"""The colour cluster's skewed T (Klinker, Shafer & Kanade): every pixel in the plane of body and light colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.report.numbers import digits, measured
from toolkit.records import ColourLayers, Floats, ModelLayers

from .svg import FAINT, FITS, INK, PAPER, figure, svg
from .tone import Tone

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 5000
ENOUGH = 200_000  # pixels to choose them from


def skewed_t(separation: ColourLayers, layers: ModelLayers, tone: Tone) -> str:
    """The figure as SVG: pixels in their own colours, the matte line, the highlight line, the angle between them."""
    body, light = np.asarray(separation.body_colour, float), np.asarray(separation.light_colour, float)
    across = _across(body, light)
    colours = _chosen(layers)
    x, y = colours @ body, colours @ across
    with figure(6.2, 4.6) as drawn:
        axes = drawn.subplots()
        axes.scatter(x, y, s=4, c=tone.show(colours + layers.pedestal), linewidths=0, rasterized=True, zorder=1)
        _lines(axes, separation, across, x, y)
        axes.set_xlabel("along the body's colour, radiance")
        axes.set_ylabel("across it, towards the light's colour")
        axes.set_title("The skewed T of the colour cluster")
        axes.margins(0.04)
        axes.legend(loc="upper left", fontsize=8.5)
        told = f"angle between body and light colour {separation.angle_deg:.1f} degrees"
        return svg(drawn, name="cluster", label=f"Colours of the pixels in the plane of body and light colour; {told}")


def _chosen(layers: ModelLayers) -> Floats:
    """Colours above the pedestal (N, 3): an even sample of the pixels and of the brightest highlights."""
    seen = layers.used.all(axis=-1) & np.isfinite(layers.model).all(axis=-1)
    index = np.flatnonzero(seen)
    index = index[:: max(1, len(index) // ENOUGH)]
    if len(index) > MOST_POINTS:
        shine = layers.specular.reshape(-1, 3)[index].sum(axis=-1)
        bright = index[np.argsort(shine, kind="stable")[-(len(index) // 12) :]]
        even = np.random.default_rng(0).permutation(index)[: MOST_POINTS // 2]
        index = np.concatenate([even, np.random.default_rng(1).permutation(bright)[: MOST_POINTS // 2]])
    return layers.photograph.reshape(-1, 3)[index] - layers.pedestal


def _across(body: Floats, light: Floats) -> Floats:
    """The unit vector at right angles to the body's colour towards the light's; any where the two are one."""
    other = light - (light @ body) * body
    if np.linalg.norm(other) < 1e-6:
        other = np.eye(3)[int(np.argmin(np.abs(body)))]
        other = other - (other @ body) * body
    return np.asarray(other / np.linalg.norm(other))


def _lines(axes: Axes, separation: ColourLayers, across: Floats, x: Floats, y: Floats) -> None:
    body, light = separation.body_colour, separation.light_colour
    corner = separation.corner if np.isfinite(separation.corner).all() else None
    end = float(np.percentile(x, 99)) if corner is None else float(corner @ body)
    axes.plot([0, end * 1.05], [0, 0], color=INK, lw=1.6, label="matte line: body colour", zorder=3)
    start = np.array([end, 0.0]) if corner is None else np.array([corner @ body, corner @ across])
    slope = np.array([light @ body, light @ across])
    reach = _reach(start, slope, x, y)
    tip = start + reach * slope
    axes.plot(
        [start[0], tip[0]], [start[1], tip[1]], color=FITS[0], lw=1.6, label="parallel to the light's colour", zorder=3
    )
    if np.isfinite(separation.highlight_colour).all():
        seen = np.array([separation.highlight_colour @ body, separation.highlight_colour @ across])
        tip = start + reach * seen
        axes.plot(
            [start[0], tip[0]], [start[1], tip[1]], color=FITS[1], lw=1.2, ls="--", label="highlight as seen", zorder=3
        )
    axes.axhline(0, color=FAINT, lw=0.6, zorder=0)
    axes.annotate(
        f"{measured(separation.angle_deg, separation.angle_sd_deg)}° ± {digits(separation.angle_sd_deg, 2)}°",
        (float(start[0]), float(start[1])),
        xytext=(10, 8),
        textcoords="offset points",
        fontsize=9,
        color=INK,
        bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.85, "pad": 1.5},
        zorder=4,
    )


def _reach(start: Floats, slope: Floats, x: Floats, y: Floats) -> float:
    """How far the highlight's pixels go from the corner along the light's colour."""
    far = (x - start[0]) * slope[0] + (y - start[1]) * slope[1]
    return float(max(np.percentile(far, 99.9), 1e-9)) if len(far) else 1.0
