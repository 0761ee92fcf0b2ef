"""What a reader of the result must know, drawn from all stages together."""

from __future__ import annotations

import numpy as np

from toolkit.flags import Flag, SampleFlag
from toolkit.geometry.sphere import surface
from toolkit.records import ColourLayers, Fit, LinearImage, Scene

CLIPPED_SHARE = 0.01  # of the sphere's samples, from which the result says so
CORE_RAD = 0.1  # about the half vector: where the highlight's core lies
CORE_SHARE = 0.02  # of the core's samples


def quality_flags(
    image: LinearImage, scene: Scene, separation: ColourLayers | None, best: Fit, preferred: int | None
) -> tuple[str, ...]:
    """The flags of the photograph and of its best fit."""
    clipped, core = clipped_shares(image, scene)
    found = {
        Flag.RELATIVE_SCALE: scene.scale == "relative",
        Flag.TRANSFER_ASSUMED: image.transfer_assumed,
        Flag.NOISE_ESTIMATED: image.noise.source == "estimated",
        Flag.CLIPPED: clipped > CLIPPED_SHARE,
        Flag.HIGHLIGHT_CLIPPED: core > CORE_SHARE,
        Flag.HIGHLIGHT_UNSEEN: np.isnan(core),
        Flag.MODEL_UNDECIDED: preferred is None,
    }
    of_colour = separation.flags if separation is not None else ()
    return tuple(dict.fromkeys([*(flag for flag, holds in found.items() if holds), *of_colour, *best.flags]))


def clipped_shares(image: LinearImage, scene: Scene) -> tuple[float, float]:
    """Share of clipped samples over the sphere and over the highlight's core; NaN where no core is in view."""
    shares = np.zeros((2, 2))
    for plane in image.planes:
        row, column = np.mgrid[: plane.values.shape[0], : plane.values.shape[1]].reshape(2, -1)
        x, y = plane.origin_px[0] + plane.step_px * column, plane.origin_px[1] + plane.step_px * row
        seen = surface(scene.camera, scene.sphere, x, y)
        clipped = (plane.flags.ravel() & SampleFlag.CLIPPED) > 0
        core = np.zeros(len(x), bool)
        for light in scene.lights:
            half = light.at(seen.normal)[0] + seen.view
            half /= np.linalg.norm(half, axis=-1, keepdims=True)
            core |= seen.on_sphere & (np.einsum("ni,ni->n", seen.normal, half) > np.cos(CORE_RAD))
        shares += [[clipped[seen.on_sphere].sum(), seen.on_sphere.sum()], [clipped[core].sum(), core.sum()]]
    with np.errstate(invalid="ignore"):
        whole, core_share = shares[:, 0] / shares[:, 1]
    return float(whole), float(core_share)
