"""Radiance along the light's plane: the samples against each fit, over the whole ball and round the highlight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.report.rows import title
from toolkit.records import Fit, Floats, MaterialReport

from .plane import BINS, Bins, angle_deg, binned, light_line, positions
from .svg import BLUE, FAINT, FITS, GREEN, INK, RED, figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CHANNELS = ((RED, "red"), (GREEN, "green"), (BLUE, "blue"))
WIDEST_DEG = 89.0
CORE = 0.01  # the highlight is shown down to this share of its peak


def whole_ball(report: MaterialReport) -> str:
    """The figure of the best fit in all three channels, as SVG."""
    best = report.fits[report.best]
    bins = [binned(report, (best,), c, edges_deg=np.linspace(-WIDEST_DEG, WIDEST_DEG, BINS + 1)) for c in range(3)]
    x, y, angle = _fine_line(best, -WIDEST_DEG, WIDEST_DEG)
    with figure(6.2, 5.0) as drawn:
        top, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        _draw_curves(top, best, x, y, angle)
        for one in bins:
            _points(top, one, CHANNELS[one.channel][0])
            _misfit(below, one, CHANNELS[one.channel][0])
        _landmarks(top, report)
        top.set_ylabel("radiance, image units")
        top.set_title("All channels against the best fit")
        top.legend(loc="upper left", fontsize=8.5, handlelength=1.6)
        _finish(below, bins)
        return svg(
            drawn, name="plane", label="Radiance against surface angle in red, green and blue, with the best fit"
        )


def highlight(report: MaterialReport, order: tuple[int, ...]) -> str:
    """The figure round the highlight, each fit against one channel; `order` ranks the fits, the best first."""
    fits = tuple(report.fits[index] for index in order[: len(FITS)])
    channel = _clearest(fits[0])
    low, high = _window(fits[0])
    pixel_deg = np.degrees(min(plane.step_px for plane in report.image.planes) / fits[0].scene.sphere.radius_px)
    edges = np.linspace(low, high, int(np.clip((high - low) / (1.2 * pixel_deg), 12, 90)) + 1)
    bins = binned(report, fits, channel, edges_deg=edges)
    x, y, angle = _fine_line(fits[0], low, high)
    with figure(6.2, 5.0) as drawn:
        top, below = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 1.6))
        from toolkit.inference.layers import predict

        for index, fit in reversed(list(enumerate(fits))):
            curve = predict(fit, x, y).model[:, channel]
            top.plot(angle, curve, color=FITS[index], lw=2.2 if index == 0 else 1.2, label=label(fit))
            below.plot(bins.angle_deg, 100 * (bins.fits[index] / bins.value - 1), color=FITS[index], lw=1.2)
        _points(top, bins, INK)
        below.errorbar(
            bins.angle_deg,
            0 * bins.value,
            100 * bins.sd / np.abs(bins.value),
            fmt=".",
            ms=2.5,
            color=INK,
            elinewidth=0.8,
        )
        top.set_title(f"The highlight, {CHANNELS[channel][1]} channel, every fit")
        top.set_ylabel("radiance, image units")
        handles, labels = top.get_legend_handles_labels()
        top.legend(handles[::-1], labels[::-1], loc="upper left", fontsize=8.5, handlelength=1.6)
        below.set_ylabel("fit − data, %")
        _limits(below, 100 * (bins.fits / bins.value - 1), 100 * bins.sd / np.abs(bins.value))
        below.set_xlabel("surface angle towards the light, °")
        return svg(drawn, name="highlight", label="Radiance round the highlight, measured and by each fit")


def label(fit: Fit) -> str:
    """A fit's name in a legend."""
    return title(fit.model) if fit.diffuse == "lambert" else f"{title(fit.model)}, {title(fit.diffuse)}"


def _fine_line(fit: Fit, low_deg: float, high_deg: float) -> tuple[Floats, Floats, Floats]:
    line = light_line(fit.scene)
    x, y = positions(fit.scene, line, np.linspace(-0.9999, 0.9999, 4001))
    angle = angle_deg(fit.scene, line, x, y)
    keep = (angle >= low_deg) & (angle <= high_deg)
    wanted = np.interp(np.linspace(low_deg, high_deg, 500), angle[keep], np.flatnonzero(keep))
    chosen = np.unique(np.rint(wanted).astype(int))
    return x[chosen], y[chosen], angle[chosen]


def _draw_curves(axes: Axes, fit: Fit, x: Floats, y: Floats, angle: Floats) -> None:
    from toolkit.inference.layers import predict

    there = predict(fit, x, y)
    for channel, (colour, name) in enumerate(CHANNELS):
        axes.plot(angle, there.model[:, channel], color=colour, lw=1.4, label=name)
        body = there.diffuse[:, channel] + there.pedestal[channel]
        axes.plot(angle, body, color=colour, lw=0.9, ls=(0, (4, 2)), label="body alone" if channel == 2 else None)


def _points(axes: Axes, bins: Bins, colour: str) -> None:
    axes.errorbar(bins.angle_deg, bins.value, bins.sd, fmt=".", ms=3, color=colour, elinewidth=0.8, alpha=0.75)


def _misfit(axes: Axes, bins: Bins, colour: str) -> None:
    lit = bins.fits[0] > 0.02 * bins.fits[0].max()
    left = 100 * (bins.value / bins.fits[0] - 1)
    axes.errorbar(
        bins.angle_deg[lit],
        left[lit],
        (100 * bins.sd / bins.fits[0])[lit],
        fmt=".",
        ms=2.5,
        color=colour,
        elinewidth=0.6,
        alpha=0.75,
    )


def _landmarks(axes: Axes, report: MaterialReport) -> None:
    """Where the light stands, where a mirror would show it, where its light ends."""
    line = light_line(report.fits[report.best].scene)
    for angle, text in ((line.half_deg, "mirror"), (line.light_deg, "light"), (line.light_deg - 90, "shadow")):
        if abs(angle) < WIDEST_DEG:
            axes.axvline(angle, color=FAINT, lw=0.8, ls=":")
            axes.text(angle, 1.0, f" {text}", transform=axes.get_xaxis_transform(), va="top", fontsize=8, color=INK)


def _finish(axes: Axes, bins: list[Bins]) -> None:
    axes.axhline(0, color=FAINT, lw=0.8)
    axes.set_xlabel("surface angle towards the light, °")
    axes.set_ylabel("data − fit, %")
    lit = [one.fits[0] > 0.02 * one.fits[0].max() for one in bins]
    left = np.concatenate([(100 * (one.value / one.fits[0] - 1))[keep] for one, keep in zip(bins, lit, strict=True)])
    noise = np.concatenate([(100 * one.sd / one.fits[0])[keep] for one, keep in zip(bins, lit, strict=True)])
    _limits(axes, left, noise)


def _limits(axes: Axes, values: Floats, noise: Floats) -> None:
    """Limits that hold nearly all values, at most 50 %, at least three times the noise."""
    seen = np.abs(values[np.isfinite(values)])
    reach = max(float(np.percentile(seen, 97)) if len(seen) else 1.0, 3 * float(np.nanmedian(noise)), 0.1)
    axes.set_ylim(-min(1.3 * reach, 50), min(1.3 * reach, 50))


def _clearest(fit: Fit) -> int:
    """The channel in which the highlight stands brightest."""
    from toolkit.inference.layers import predict

    x, y, _ = _fine_line(fit, -WIDEST_DEG, WIDEST_DEG)
    return int(np.argmax(predict(fit, x, y).specular.max(axis=0)))


def _window(fit: Fit) -> tuple[float, float]:
    """The angles between which the best fit's highlight stands above one percent of its peak, and a little more."""
    from toolkit.inference.layers import predict

    x, y, angle = _fine_line(fit, -WIDEST_DEG, WIDEST_DEG)
    specular = predict(fit, x, y).specular.sum(axis=-1)
    if not specular.max() > 0.0:
        return -WIDEST_DEG, WIDEST_DEG
    seen = angle[specular > CORE * specular.max()]
    margin = 0.15 * (seen[-1] - seen[0]) + 0.5
    return max(float(seen[0] - margin), -WIDEST_DEG), min(float(seen[-1] + margin), WIDEST_DEG)
