"""The validation page's figures: are ranks even, and where does it start to fail?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.report.figures.svg import FAINT, FITS, INK, figure, svg

from .design import LINEAR, VARIABLES
from .ranks import band
from .score import Score, model_of
from .stress import z_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BINS = 9  # of a variable's range
LABELS = {
    "light_off_axis_deg": "light off the camera's axis, degrees",
    "light_sd_deg": "stated error of the light, degrees",
    "radius_px": "ball's radius, px",
    "place_sd_px": "stated error of the sphere, px",
    "electrons": "electrons at saturation",
    "highlight": "brightest pixel over saturation",
    "albedo": "albedo's level",
    "specular": "specular strength",
}


def rank_plots(found: Score) -> str:
    """The empirical distribution of the ranks of every group, less the even one, in its simultaneous band."""
    groups = found.groups
    columns = 4
    rows = -(-len(groups) // columns)
    with figure(11.0, 1.75 * rows) as drawn:
        axes = drawn.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for ax, group in zip(axes.flat, groups, strict=False):
            _ranks(ax, np.array(group.ranks), group.count)
            ax.set_title(f"{group.name}\n{group.model}", fontsize=8, fontweight="normal")
        for ax in axes.flat[len(groups) :]:
            ax.set_visible(False)
        drawn.subplots_adjust(left=0.06, right=0.995, top=1 - 0.4 / rows / 1.75, bottom=0.4 / rows / 1.75, hspace=0.55)
        return svg(drawn, name="ranks", label="Ranks of the truths among posterior draws, less an even distribution")


def _ranks(ax: Axes, ranks: Any, count: int) -> None:  # noqa: ANN401  # an array of floats
    at, low, high = band(count)
    ax.fill_between(at, low - at, high - at, color=FAINT, alpha=0.25, linewidth=0)
    share = np.searchsorted(np.sort(ranks), at, side="right") / len(ranks)
    ax.plot(at, share - at, color=FITS[0], lw=1.2)
    ax.axhline(0.0, color=FAINT, lw=0.6)
    ax.tick_params(labelsize=7)


def z_plots(lines: Sequence[Mapping[str, Any]]) -> str:
    """Root mean square z of the renders against each variable of the scene: 1 where intervals are right."""
    clean = [line for line in lines if line["status"] == "done" and not line["broken"] and line["scene"]]
    columns, rows = 4, 2
    with figure(11.0, 5.0) as drawn:
        axes = drawn.subplots(rows, columns, sharey=True)
        for ax, name in zip(axes.flat, VARIABLES, strict=False):
            _against(ax, clean, name)
        for ax in axes.flat[len(VARIABLES) :]:
            ax.set_visible(False)
        for ax in axes[:, 0]:
            ax.set_ylabel("rms z of a render")
        drawn.subplots_adjust(left=0.06, right=0.995, top=0.97, bottom=0.1, hspace=0.35, wspace=0.08)
        return svg(drawn, name="against", label="Root mean square z of each render against the scene's variables")


def _against(ax: Axes, clean: Sequence[Mapping[str, Any]], name: str) -> None:
    x = np.array([line["scene"][name] for line in clean])
    rms = np.array([np.sqrt(np.mean([z_of(n) ** 2 for n in line["numbers"]])) for line in clean])
    order = np.argsort(x)
    ax.scatter(x, np.minimum(rms, 4.0), s=5, color=FITS[1], alpha=0.35, linewidths=0)
    parts = [part for part in np.array_split(order, BINS) if len(part)]
    middle = [float(np.median(x[part])) for part in parts]
    pooled = [float(np.sqrt(np.mean(rms[part] ** 2))) for part in parts]
    ax.plot(middle, pooled, color=FITS[0], lw=1.6, marker="o", ms=3)
    ax.axhline(1.0, color=INK, lw=0.8)
    if name not in LINEAR:
        _logarithmic(ax, x)
    ax.set_ylim(0.0, 4.1)
    ax.set_xlabel(LABELS[name])


def _logarithmic(ax: Axes, x: Any) -> None:  # noqa: ANN401  # an array of floats
    """Few labels, as a person writes them."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ax.set_xscale("log")
    steps = [m * 10.0**e for e in range(-3, 6) for m in (1, 2, 5)]
    shown = [s for s in steps if x.min() <= s <= x.max()]
    ax.xaxis.set_major_locator(FixedLocator(shown[:: 1 + len(shown) // 5]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.15g}"))


def model_plot(lines: Sequence[Mapping[str, Any]]) -> str:
    """Separation: PSNR of the diffuse layer, one column of points a model."""
    clean = [line for line in lines if line["status"] == "done" and not line["broken"] and line["psnr_db"] is not None]
    names = sorted({model_of(line) for line in clean})
    with figure(11.0, 2.8) as drawn:
        ax = drawn.subplots()
        rng = np.random.default_rng(0)
        for i, name in enumerate(names):
            values = np.array([line["psnr_db"] for line in clean if model_of(line) == name])
            ax.scatter(i + 0.18 * rng.uniform(-1, 1, len(values)), values, s=6, color=FITS[1], alpha=0.4, linewidths=0)
            ax.plot([i - 0.3, i + 0.3], [np.median(values)] * 2, color=FITS[0], lw=2)
        ax.set_xticks(range(len(names)), names, fontsize=8)
        ax.set_ylabel("PSNR of the diffuse layer, dB")
        drawn.subplots_adjust(left=0.06, right=0.995, top=0.97, bottom=0.12)
        return svg(drawn, name="psnr", label="Peak signal to noise of the separated diffuse layer for each model")
