"""The posterior of the best fit, each number against each other (corner; Foreman-Mackey 2016)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.records import Fit, Floats

from .svg import FITS, INK, figure, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_NUMBERS = 6
MOST_DRAWS = 6000
GREEN = 1
LEFT_OUT = ("specular_f0",)  # follows from the strength


def corner_plot(fit: Fit) -> str | None:
    """The figure as SVG; None where there are no draws that vary. Lines mark 16, 50 and 84 %; rings 39 and 86 %."""
    columns = _columns(fit)
    if len(columns) == 0:
        return None
    import warnings

    import corner

    draws = np.stack(list(columns.values()), axis=-1)
    draws = draws[:: max(1, len(draws) // MOST_DRAWS)]
    with figure(6.2, 6.2) as drawn, warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # corner warns of empty levels where a posterior is narrow, and draws all the same
        corner.corner(
            draws,
            labels=list(columns),
            fig=drawn,
            color=INK,
            quantiles=(0.16, 0.5, 0.84),
            levels=(0.393, 0.865),
            bins=24,
            smooth=1.0,
            max_n_ticks=3,
            plot_datapoints=False,
            plot_density=False,
            fill_contours=False,
            no_fill_contours=True,
            hist_kwargs={"color": FITS[0], "lw": 1.1},
            contour_kwargs={"colors": [FITS[0]], "linewidths": 1.0},
            labelpad=0.22,
        )
        drawn.subplots_adjust(left=0.17, right=0.99, bottom=0.17, top=0.99)
        for axes in drawn.axes:
            axes.tick_params(labelsize=8)
            _fewer_ticks(axes)
        return svg(drawn, name="corner", label="Posterior of each number of the best fit against each other")


def _fewer_ticks(axes: Axes) -> None:
    """At most three labels a side, none at the ends, where they would meet the neighbour's."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_visible() and len(axis.get_ticklocs()) > 0:
            axis.set_major_locator(MaxNLocator(3, prune="both"))


def _columns(fit: Fit) -> dict[str, Floats]:
    """Draws (N,) by label: the shape, then each colour's green, which shows how the channels move together."""
    found: dict[str, Floats] = {}
    for name, draws in sorted(fit.draws.items(), key=lambda item: np.ndim(item[1])):
        if name not in LEFT_OUT:
            one = np.ravel(draws if np.ndim(draws) == 2 else draws[..., GREEN])
            found[label_of(name) + ("" if np.ndim(draws) == 2 else ", G")] = one
    kept = {name: values for name, values in found.items() if np.isfinite(values).all() and np.ptp(values) > 0.0}
    return dict(list(kept.items())[:MOST_NUMBERS])


def label_of(name: str) -> str:
    """A parameter's name as an axis carries it."""
    return name.replace("_rad", " / rad").replace("_", "\n")
