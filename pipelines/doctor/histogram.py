"""How the samples of the ball, or of the frame, lie in the range: counts by stops below white."""

from __future__ import annotations

import numpy as np

from pipelines.report.figures.svg import BLUE, FAINT, GREEN, INK, RED, figure, svg
from toolkit.records import Floats

from .exposure import samples_of
from .records import Examination

CHANNELS = ((RED, "red"), (GREEN, "green"), (BLUE, "blue"))
STOPS = (-12.0, 0.5)
STEP = 1.0 / 6.0


def histogram(found: Examination) -> str | None:
    """The figure as SVG; None where there are no measurements."""
    image, exposure = found.image, found.exposure
    if image is None or exposure is None:
        return None
    top = image.white if np.isfinite(image.white) else max(float(exposure.peak.max()), 1e-12)
    edges = np.arange(STOPS[0], STOPS[1] + STEP, STEP)
    with figure(6.2, 2.6) as drawn:
        drawn.subplots_adjust(bottom=0.19, top=0.9)
        axes = drawn.subplots()
        for channel, (colour, name) in enumerate(CHANNELS):
            share = _shares(samples_of(image, found.scene, channel) / top, edges)
            axes.stairs(share, edges, color=colour, lw=1.3, label=name)
            axes.plot(
                np.log2(max(float(exposure.body[channel]) / top, 1e-9)),
                0.0,
                marker="^",
                color=colour,
                ms=6,
                clip_on=False,
            )
        axes.axvline(0.0, color=FAINT, lw=1.0, ls="--")
        axes.text(
            0.0,
            1.0,
            " white" if np.isfinite(image.white) else " peak",
            transform=axes.get_xaxis_transform(),
            va="top",
            fontsize=8,
            color=INK,
        )
        axes.set_xlim(*STOPS)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel(f"stops below {'white' if np.isfinite(image.white) else 'the peak'}")
        axes.set_ylabel(f"% of the {exposure.of}'s samples")
        axes.legend(loc="upper left", fontsize=8.5, handlelength=1.6)
        return svg(drawn, name="histogram", label=f"How bright the samples of the {exposure.of} are, by channel")


def _shares(values: Floats, edges: Floats) -> Floats:
    """Percent of the samples in each bin; what is darker than all bins counts in the first."""
    stops = np.log2(np.maximum(values, 2.0 ** edges[0] * 1.0001))
    return np.asarray(100.0 * np.histogram(np.minimum(stops, edges[-1] - 1e-6), edges)[0] / max(len(values), 1))
