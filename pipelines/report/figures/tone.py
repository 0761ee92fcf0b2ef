"""How radiance becomes a picture on a screen: one tone curve for all pictures of a page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.export.colour import srgb_encode
from pipelines.srgb import light_of
from toolkit.records import Floats, MaterialReport, readonly

KNEE = 0.6  # linear up to here, then a shoulder that never clips
BRIGHT_BODY = 0.6  # where the body's brightest part is shown, linear


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tone:
    """`matrix` (3, 3) takes camera radiance to linear display red, green, blue; a white surface comes out grey."""

    matrix: Floats
    in_srgb: bool  # whether the colours are true, or the camera's own

    def __post_init__(self) -> None:
        readonly(self)

    def show(self, radiance: Floats) -> Floats:
        """Display values 0 .. 1, same shape (..., 3)."""
        linear = np.maximum(np.nan_to_num(radiance) @ self.matrix.T, 0.0)
        over = np.maximum(linear - KNEE, 0.0)
        return srgb_encode(np.where(linear > KNEE, KNEE + (1 - KNEE) * (1 - np.exp(-over / (1 - KNEE))), linear))


def tone_of(report: MaterialReport, diffuse: Floats) -> Tone:
    """The curve under which the body of this ball, `diffuse` (h, w, 3), is well exposed and its light looks white."""
    colour = report.colour
    matrix = (np.eye(3) if colour is None else colour.to_srgb) / light_of(report)
    body = diffuse[np.isfinite(diffuse).all(axis=-1)] @ matrix.T
    bright = float(np.percentile(body.max(axis=-1), 99)) if len(body) else 0.0
    return Tone(matrix=matrix * (BRIGHT_BODY / bright if bright > 0.0 else 1.0), in_srgb=colour is not None)
