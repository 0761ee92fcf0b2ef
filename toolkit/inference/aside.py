"""A drawn layer a fraction of a pixel aside, by its own slope: a mosaic's channels lie beside their quad's middle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats


def draw_aside(places: Floats, drawn: NDArray[np.float32], limb: NDArray[np.intp], layer: NDArray[np.float32]) -> None:
    """Into a layer (3, h, w) what is drawn with a line and a column more on every side, (3, h + 2, w + 2).

    Each channel at its place (3, 2) in pixels beside the pixel's own; `limb_of` the sphere stays.
    """
    width = drawn.shape[2]
    for channel, (dx, dy), to in zip(drawn, places.astype(np.float32), layer, strict=True):
        here = middle = _moved(channel, 0)
        if dx or dy:
            here = _moved(channel, width) - _moved(channel, -width)
            here *= dy / 2
            slope = _moved(channel, 1) - _moved(channel, -1)
            slope *= dx / 2
            here += slope
            here += middle
            np.clip(here, 0.0, np.inf, out=here)
            here[limb] = middle[limb]
        to[...] = here.reshape(-1, width)[:, 1:-1]


def limb_of(shown: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Which places of all lines (h + 2, w + 2) but the first and the last lack a neighbour on the sphere."""
    width = shown.shape[1]
    whole = _moved(shown, 1) & _moved(shown, -1) & _moved(shown, width) & _moved(shown, -width)
    return np.flatnonzero(_moved(shown, 0) & ~whole)


def _moved(lines: NDArray[Any], places: int) -> NDArray[Any]:
    """All lines (h, w) but the first and the last, one after the other as they lie in memory, some places on.

    Of a line's ends, whose neighbours there are of the next line, nothing may be kept: columns by themselves would take
    twice as long.
    """
    first = lines.shape[1] + places
    return lines.ravel()[first : first + lines.size - 2 * lines.shape[1]]
