"""The highlight along the light's plane: one channel's samples against every fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.report.rows import title
from toolkit.inference.layers import predict
from toolkit.records import Fit, Floats, MaterialReport

from .plane import Bins, binned
from .profile import CHANNELS, WIDEST_DEG, fine_line, limits, points, white_level
from .svg import FITS, INK, PAPER, figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CORE = 0.01  # the highlight is shown down to this share of its peak
BIN_PX = 1.2  # a bin is no finer than the samples
FEWEST, MOST = 12, 90  # bins


def highlight(report: MaterialReport, order: tuple[int, ...]) -> str:
    """The figure as SVG; `order` ranks the fits, the best first."""
    fits = tuple(report.fits[index] for index in order[: len(FITS)])
    x, y, angle = fine_line(fits[0], -WIDEST_DEG, WIDEST_DEG)
    shine = predict(fits[0], x, y).specular
    channel = int(np.argmax(shine.max(axis=0)))
    low, high = _window(angle, shine.sum(axis=-1))
    bins = binned(report, fits, channel, edges_deg=_edges(report, low, high))
    x, y, angle = fine_line(fits[0], low, high)
    curves = np.array([predict(fit, x, y).model[:, channel] for fit in fits])
    with figure(6.2, 5.0) as drawn:
        top, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1.6))
        _curves(top, angle, curves, fits)
        points(top, bins, INK)
        white_level(top, report, peak=float(curves[0].max()), seen=float(bins.value.max(initial=0.0)))
        _misfits(below, bins, float(np.ptp(_edges(report, low, high)[:2])))
        top.set_title(f"The highlight, {CHANNELS[channel][1]} channel, every fit")
        top.set_ylabel("radiance, image units")
        _legend(top)
        below.set_ylabel("fit − data, %")
        below.set_xlabel("surface angle towards the light, °")
        return svg(drawn, name="highlight", label="Radiance round the highlight, measured and by each fit")


def _window(angle: Floats, shine: Floats) -> tuple[float, float]:
    """The angles between which the highlight stands above one percent of its peak, and a little more."""
    if not shine.max() > 0.0:
        return -WIDEST_DEG, WIDEST_DEG
    seen = angle[shine > CORE * shine.max()]
    margin = 0.15 * (seen[-1] - seen[0]) + 0.5
    return max(float(seen[0] - margin), -WIDEST_DEG), min(float(seen[-1] + margin), WIDEST_DEG)


def _edges(report: MaterialReport, low_deg: float, high_deg: float) -> Floats:
    step_px = min(plane.step_px for plane in report.image.planes)
    finest_deg = np.degrees(BIN_PX * step_px / report.scene.sphere.radius_px)
    return np.linspace(low_deg, high_deg, int(np.clip((high_deg - low_deg) / finest_deg, FEWEST, MOST)) + 1)


def _curves(axes: Axes, angle: Floats, curves: Floats, fits: tuple[Fit, ...]) -> None:
    for index in reversed(range(len(fits))):  # the best on top
        fit = fits[index]
        name = title(fit.model) if fit.diffuse == "lambert" else f"{title(fit.model)}, {title(fit.diffuse)}"
        axes.plot(angle, curves[index], color=FITS[index], lw=2.2 if index == 0 else 1.2, label=name)


def _misfits(axes: Axes, bins: Bins, bin_deg: float) -> None:
    """Each fit over the data, %, broken where samples are clipped; the data's own noise round zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        off = 100 * (bins.fits / bins.value - 1)
        noise = 100 * bins.sd / np.abs(bins.value)
    gaps = np.flatnonzero(np.diff(bins.angle_deg) > 1.8 * bin_deg) + 1
    for index in reversed(range(len(off))):
        broken = (np.insert(values, gaps, np.nan) for values in (bins.angle_deg, off[index]))
        axes.plot(*broken, color=FITS[index], lw=1.2)
    axes.errorbar(bins.angle_deg, 0 * noise, noise, fmt=".", ms=2.5, color=INK, elinewidth=0.8)
    limits(axes, off, noise)


def _legend(axes: Axes) -> None:
    """The best fit's name first; above the curves."""
    low, high = axes.get_ylim()
    handles, labels = axes.get_legend_handles_labels()
    rows = -(-len(labels) // 2)
    axes.set_ylim(low, high + 0.075 * rows * (high - low))
    frame: dict[str, Any] = {"frameon": True, "facecolor": PAPER, "edgecolor": "none", "framealpha": 0.85}
    axes.legend(handles[::-1], labels[::-1], loc="upper left", ncols=2, fontsize=7.5, handlelength=1.3, **frame)
