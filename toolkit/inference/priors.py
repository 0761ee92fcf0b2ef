"""What is known of the linear unknowns before the photograph is looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .normal import Layout, Prior, numbered
from .views import View, irradiance_scale, signal_scale

PEDESTAL_SD = 0.002  # prior of the black level's error, of the signal's 99th percentile


def prior_of(layout: Layout, views: Sequence[View]) -> Prior:
    """Of the linear unknowns: colours at least 0 with a prior too wide to matter, F0 at most 1, pedestals near 0."""
    signals = {numbered("pedestal", v): max(signal_scale(view.cells), 1e-12) for v, view in enumerate(views)}
    bright = max(signals[numbered("pedestal", v)] / irradiance_scale(view.scene) for v, view in enumerate(views))
    low, high, precision = np.zeros(layout.size), np.full(layout.size, np.inf), np.zeros((layout.size, layout.size))
    for i, (name, _) in enumerate(layout.names):
        precision[i, i] = (PEDESTAL_SD * signals[name] if name in signals else 1e4 * bright) ** -2
        if name in signals:
            low[i] = -np.inf
        if name == "specular_f0":
            high[i] = 1.0
    return Prior(precision=precision, centre=np.zeros(layout.size), low=low, high=high)
