"""The ball in its frame: how large, how near to the edge, how dark what is around it."""

from __future__ import annotations

import numpy as np

from toolkit.geometry.project import limb_px
from toolkit.radiometry.quads import Quads
from toolkit.records import Floats, Scene

from .records import Exposure, Surroundings
from .samples import Ball

RING = (1.06, 1.3)  # of the outline's distances from its centre: what is near but not blurred with the ball
UNLIT = -0.2  # n.l below which the lamp gives nothing, whatever its size
FEWEST = 50


def surroundings_of(whole: Quads, scene: Scene, ball: Ball, exposure: Exposure, frame: tuple[int, int]) -> Surroundings:
    """`whole` is the picture of the frame, `frame` its (height, width)."""
    outline = limb_px(scene.camera, scene.sphere)
    height, width = frame
    x, y = outline.T
    margin = min(x.min(), y.min(), width - 1 - x.max(), height - 1 - y.max())
    body = float(exposure.body.mean())
    return Surroundings(
        frame_share=float(max(np.ptp(x), np.ptp(y)) / min(height, width)),
        margin_px=float(margin),
        background_share=_share(_ring(whole, outline), body),
        shadow_share=_share(_shadow(scene, ball), body),
    )


def _share(values: Floats, body: float) -> float | None:
    return float(np.median(values)) / body if len(values) >= FEWEST and body > 0.0 else None


def _ring(whole: Quads, outline: Floats) -> Floats:
    centre = outline.mean(axis=0)
    steps = np.linspace(*RING, 9)
    places = (centre + steps[:, None, None] * (outline - centre)).reshape(-1, 2)
    column, row = np.rint((places - whole.origin_px) / whole.step_px).astype(int).T
    inside = (row >= 0) & (row < whole.values.shape[0]) & (column >= 0) & (column < whole.values.shape[1])
    return np.asarray(whole.values[row[inside], column[inside]].mean(axis=1))


def _shadow(scene: Scene, ball: Ball) -> Floats:
    """Brightness of the ball's unlit side, which only stray light reaches; empty where all of it is lit."""
    if len(scene.lights) != 1:
        return np.empty(0)
    unlit = ball.normal @ np.asarray(scene.lights[0].direction) < UNLIT
    return np.asarray(ball.value[unlit].mean(axis=1))
