"""The highlight line and the T's corner: where the highlight leaves the matte line, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .samples import Blocks

LEAST = 3  # blocks of highlight that a line needs
STANDS_OUT = 6.0  # sd above the matte line


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HighlightLine:
    """`corner` (3,) radiance on the matte line; `direction` (3,) unit, of the highlight's cluster as seen."""

    corner: Floats
    direction: Floats
    share: float  # of the blocks, those that show highlight

    def __post_init__(self) -> None:
        readonly(self)


def highlight_line(cloud: Blocks, body: Floats, light: Floats) -> HighlightLine | None:
    """The line through the blocks that stand out from the matte line; None where too few do."""
    pair = np.stack([body, light], axis=1)
    inverse = np.linalg.pinv(pair)
    a, s = inverse @ cloud.colour.T
    sd = np.sqrt(cloud.variance @ inverse[1] ** 2)
    out = s > np.maximum(STANDS_OUT * sd, 0.1 * float(s.max()))
    if np.count_nonzero(out) < LEAST:
        return None
    slope, corner = _line(s[out], a[out])
    direction = light + slope * body
    return HighlightLine(
        corner=max(float(corner), 0.0) * body,
        direction=direction / max(float(np.linalg.norm(direction)), 1e-300),
        share=float(out.mean()),
    )


def _line(s: Floats, a: Floats) -> tuple[float, float]:
    """Slope and start of a = start + slope s, weighted by s; no slope where all highlights are of one strength."""
    mean_s, mean_a = float(np.average(s, weights=s)), float(np.average(a, weights=s))
    spread = float(s @ (s - mean_s) ** 2)
    slope = float(s @ ((s - mean_s) * (a - mean_a))) / spread if spread > 1e-12 * mean_s**2 * float(s.sum()) else 0.0
    return slope, mean_a - slope * mean_s
