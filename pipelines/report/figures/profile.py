"""Radiance along the light's plane over the whole ball: all channels against the best fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.inference.layers import Prediction, predict
from toolkit.records import Fit, Floats, MaterialReport

from .plane import BINS, Bins, angle_deg, binned, light_line, positions
from .svg import BLUE, FAINT, GREEN, INK, RED, figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CHANNELS = ((RED, "red"), (GREEN, "green"), (BLUE, "blue"))
WIDEST_DEG = 89.0
LIT = 0.02  # of the brightest: below it a percentage says nothing
TOO_CLOSE_DEG = 25.0  # two landmarks nearer than this are labelled at two heights


def whole_ball(report: MaterialReport) -> str:
    """The figure of the best fit in all three channels, as SVG."""
    best = report.fits[report.best]
    edges = np.linspace(-WIDEST_DEG, WIDEST_DEG, BINS + 1)
    bins = [binned(report, (best,), channel, edges_deg=edges) for channel in range(3)]
    x, y, angle = fine_line(best, -WIDEST_DEG, WIDEST_DEG)
    there = predict(best, x, y)
    with figure(6.2, 5.0) as drawn:
        top, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        _curves(top, there, angle)
        for one in bins:
            points(top, one, CHANNELS[one.channel][0])
            _misfit(below, one, CHANNELS[one.channel][0])
        brightest = max(float(one.value.max(initial=0.0)) for one in bins)
        white_level(top, report, peak=float(there.model.max()), seen=brightest)
        _landmarks(top, report)
        top.set_ylabel("radiance, image units")
        top.set_title("All channels against the best fit")
        top.legend(loc="upper left", fontsize=8.5, handlelength=1.6)
        below.axhline(0, color=FAINT, lw=0.8)
        below.set_xlabel("surface angle towards the light, °")
        below.set_ylabel("data − fit, %")
        percents = [_left(one) for one in bins]
        limits(below, np.concatenate([left for left, _ in percents]), np.concatenate([sd for _, sd in percents]))
        label = "Radiance against surface angle in red, green and blue, with the best fit"
        return svg(drawn, name="plane", label=label)


def fine_line(fit: Fit, low_deg: float, high_deg: float) -> tuple[Floats, Floats, Floats]:
    """Pixel coordinates and angles of five hundred places along the light's plane, evenly spaced in angle."""
    line = light_line(fit.scene)
    x, y = positions(fit.scene, line, np.linspace(-0.9999, 0.9999, 4001))
    angle = angle_deg(fit.scene, line, x, y)
    keep = (angle >= low_deg) & (angle <= high_deg)
    wanted = np.interp(np.linspace(low_deg, high_deg, 500), angle[keep], np.flatnonzero(keep))
    chosen = np.unique(np.rint(wanted).astype(int))
    return x[chosen], y[chosen], angle[chosen]


def points(axes: Axes, bins: Bins, colour: str) -> None:
    """The samples' means with their noise."""
    axes.errorbar(bins.angle_deg, bins.value, bins.sd, fmt=".", ms=3, color=colour, elinewidth=0.8, alpha=0.75)


def white_level(axes: Axes, report: MaterialReport, *, peak: float, seen: float) -> None:
    """Where fits rise beyond what a sample can hold: cut not far above the brightest one `seen`, and say so."""
    white = report.image.white
    if not peak > white:
        return
    top = min(1.05 * peak, max(1.6 * seen, 0.1 * white))
    axes.set_ylim(-0.05 * top, top)
    axes.axhline(white, color=FAINT, lw=0.8, ls="--")
    told = f"samples clip at {white:g}; the fit peaks at {peak:.2g}"
    axes.text(0.99, 0.8, told, transform=axes.transAxes, ha="right", va="top", fontsize=8, color=INK)


def limits(axes: Axes, values: Floats, noise: Floats) -> None:
    """Limits that hold nearly all values (%), at least three times the noise, at most 50 %."""
    seen, noise = np.abs(values[np.isfinite(values)]), noise[np.isfinite(noise)]
    reach = max(
        float(np.percentile(seen, 97)) if len(seen) else 1.0, 3 * float(np.median(noise)) if len(noise) else 0.0, 0.1
    )
    axes.set_ylim(-min(1.3 * reach, 50), min(1.3 * reach, 50))


def _curves(axes: Axes, there: Prediction, angle: Floats) -> None:
    for channel, (colour, name) in enumerate(CHANNELS):
        axes.plot(angle, there.model[:, channel], color=colour, lw=1.4, label=name)
        body = there.diffuse[:, channel] + there.pedestal[channel]
        axes.plot(angle, body, color=colour, lw=0.9, ls=(0, (4, 2)), label="body alone" if channel == 2 else None)


def _misfit(axes: Axes, bins: Bins, colour: str) -> None:
    lit = _lit(bins)
    left, sd = _left(bins)
    axes.errorbar(bins.angle_deg[lit], left, sd, fmt=".", ms=2.5, color=colour, elinewidth=0.6, alpha=0.75)


def _lit(bins: Bins) -> Floats:
    return np.asarray(bins.fits[0] > LIT * bins.fits[0].max(initial=0.0))


def _left(bins: Bins) -> tuple[Floats, Floats]:
    """What the fit leaves where there is light, and the noise, % of the fit."""
    lit = _lit(bins)
    fitted = bins.fits[0][lit]
    return np.asarray(100 * (bins.value[lit] / fitted - 1)), np.asarray(100 * bins.sd[lit] / fitted)


def _landmarks(axes: Axes, report: MaterialReport) -> None:
    """Where the light stands, where a mirror would show it, where its light ends."""
    line = light_line(report.fits[report.best].scene)
    crowded = abs(line.light_deg - line.half_deg) < TOO_CLOSE_DEG
    marks = ((line.half_deg, "mirror", 1.0), (line.light_deg, "light", 0.93), (line.light_deg - 90, "shadow", 1.0))
    for angle, text, height in marks:
        if abs(angle) < WIDEST_DEG:
            axes.axvline(angle, color=FAINT, lw=0.8, ls=":")
            place = height if crowded else 1.0
            axes.text(angle, place, f" {text}", transform=axes.get_xaxis_transform(), va="top", fontsize=8, color=INK)
