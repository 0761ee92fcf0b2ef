"""The ball's pixels with their surface: what all parts of an examination look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag, flagged
from toolkit.geometry.sphere import surface
from toolkit.radiometry.quads import Quads, quads
from toolkit.records import Floats, LinearImage, Scene, readonly

FACING = 0.2  # n.v: nearer to the limb blur and background mix in
MOST = 400_000  # pixels looked at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ball:
    """Pixels (N,) that face the camera; `value` (N, 3), `cosine` (N,) of the first light, 0 where there is none."""

    x: Floats
    y: Floats
    normal: Floats  # (N, 3)
    value: Floats
    clipped: NDArray[np.bool_]
    cosine: Floats
    step_px: float

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def lit(self) -> NDArray[np.bool_]:
        """What the light reaches well; the brighter half where no light is known."""
        if self.cosine.any():
            return np.asarray(self.cosine > 0.3)
        bright = self.value.mean(axis=1)
        return np.asarray(bright >= np.median(bright))


def ball_of(image: LinearImage, scene: Scene) -> Ball:
    """The ball's pixels, a mosaic's as quads."""
    picture = thinned(quads(image), scene)
    row, column = np.mgrid[: picture.values.shape[0], : picture.values.shape[1]].reshape(2, -1)
    x, y = picture.origin_px[0] + picture.step_px * column, picture.origin_px[1] + picture.step_px * row
    seen = surface(scene.camera, scene.sphere, x, y)
    flags = picture.flags.ravel()
    on = seen.on_sphere & (np.einsum("ni,ni->n", seen.normal, seen.view) > FACING)
    on &= ~flagged(flags, SampleFlag.INVALID)
    light = np.asarray(scene.lights[0].direction) if scene.lights else np.zeros(3)
    return Ball(
        x=x[on],
        y=y[on],
        normal=seen.normal[on],
        value=picture.values.reshape(-1, 3)[on].astype(float),
        clipped=flagged(flags[on], SampleFlag.CLIPPED),
        cosine=np.maximum(seen.normal[on] @ light, 0.0),
        step_px=float(picture.step_px),
    )


def thinned(picture: Quads, scene: Scene) -> Quads:
    """Every second, third ... pixel of a large ball: enough for medians and a highlight's place."""
    across = 2.0 * scene.sphere.radius_px / picture.step_px
    keep = max(int(np.ceil(across / np.sqrt(MOST))), 1)
    return Quads(
        values=picture.values[::keep, ::keep],
        flags=picture.flags[::keep, ::keep],
        origin_px=picture.origin_px,
        step_px=picture.step_px * keep,
    )
