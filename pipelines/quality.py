"""What a reader of the result must know, drawn from all stages together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import Flag, SampleFlag, flagged
from toolkit.geometry.sphere import surface
from toolkit.records import Fit, Floats, LinearImage, Photograph, Plane, Scene
from toolkit.reflectance.cosines import Cosines

CLIPPED_SHARE = 0.01  # of the sphere's samples, from which the result says so
CORE_RAD = 0.1  # about the half vector: where the highlight's core lies
CORE_SHARE = 0.02  # of the core's samples
CORE_ROWS = 8.0  # of samples across the core's radius are enough to count its samples
GLARE_SHARE = 0.5  # of as many samples as are clipped


def shown_flags(image: LinearImage, scene: Scene) -> tuple[Flag, ...]:
    """The flags of the photograph's samples alone, whatever is fitted to them."""
    clipped, core = clipped_shares(image, scene)
    found = {
        Flag.CLIPPED: clipped > CLIPPED_SHARE,
        Flag.HIGHLIGHT_CLIPPED: core > CORE_SHARE,
        Flag.HIGHLIGHT_UNSEEN: np.isnan(core),
        Flag.GLARE: glares(image),
    }
    return tuple(flag for flag, holds in found.items() if holds)


def quality_flags(seen: Photograph, shown: Sequence[Flag], best: Fit, preferred: int | None) -> tuple[str, ...]:
    """The flags of the photograph, among them those that its samples have `shown`, and of its best fit."""
    image, separation = seen.image, seen.separation
    found = {
        Flag.RELATIVE_SCALE: best.scale == "relative",
        Flag.TRANSFER_ASSUMED: image.transfer_assumed,
        Flag.NOISE_ESTIMATED: image.noise.source == "estimated",
        **dict.fromkeys(shown, True),
        Flag.MODEL_UNDECIDED: preferred is None,
        Flag.COLOUR_CANNOT_SEPARATE: seen.agreement is not None
        and (
            separation is None or Flag.COLOUR_CANNOT_SEPARATE in separation.flags
        ),  # the separation's other flags are about its own layers and stay with them
        Flag.LAYERS_DISAGREE: seen.agreement is not None and seen.agreement.disagree,
    }
    return tuple(dict.fromkeys([*(flag for flag, holds in found.items() if holds), *best.flags]))


def clipped_shares(image: LinearImage, scene: Scene) -> tuple[float, float]:
    """Share of clipped samples over the sphere and over the highlight's core; NaN where no core is in view."""
    core, core_clipped, sphere_clipped, samples = 0, 0, 0, 0.0
    for plane in image.planes:
        clipped = np.flatnonzero(flagged(plane.flags, SampleFlag.CLIPPED))
        row, column = np.unravel_index(clipped, plane.flags.shape)
        on_sphere, in_core = _where(scene, *_places(plane, row, column))
        sphere_clipped += int(on_sphere.sum())
        core_clipped += int(in_core.sum())
        samples += np.pi * (scene.sphere.radius_px / plane.step_px) ** 2
        thin = max(int(CORE_RAD * scene.sphere.radius_px / plane.step_px / CORE_ROWS), 1)
        row, column = np.mgrid[: plane.flags.shape[0] : thin, : plane.flags.shape[1] : thin].reshape(2, -1)
        core += thin**2 * int(_where(scene, *_places(plane, row, column))[1].sum())
    return sphere_clipped / samples, core_clipped / core if core else float("nan")


def glares(image: LinearImage) -> bool:
    """Whether glare brightens samples in number, beside those that clip."""
    return count_of(image, SampleFlag.GLARE) > GLARE_SHARE * count_of(image, SampleFlag.CLIPPED)


def count_of(image: LinearImage, kinds: SampleFlag) -> int:
    """How many samples of a photograph bear one of these kinds of flag."""
    return sum(int(np.count_nonzero(flagged(plane.flags, kinds))) for plane in image.planes)


def _places(plane: Plane, row: NDArray[np.intp], column: NDArray[np.intp]) -> tuple[Floats, Floats]:
    (x0, y0), step = plane.origin_px, plane.step_px
    return x0 + step * column, y0 + step * row


def _where(scene: Scene, x: Floats, y: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which places lie on the sphere, and which of them in the core of a light's highlight."""
    seen = surface(scene.camera, scene.sphere, x, y)
    core = np.zeros(len(x), bool)
    for light in scene.lights:
        core |= Cosines.of(seen.normal, light.at(seen.normal)[0], seen.view).n_dot_h > np.cos(CORE_RAD)
    return seen.on_sphere, core & seen.on_sphere
