"""Exposure and light as the photograph itself shows them: all clipped, all dark, lit from elsewhere.

Each test is one that no good photograph fails; what is merely poor is fitted, and flagged. They look at means over
square blocks of samples, a thousand or so on the sphere, where noise and single hot samples no longer count.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag, flagged
from toolkit.geometry.sphere import on_sphere, surface
from toolkit.records import Floats, LinearImage, Plane, Scene

from .checks import written
from .quality import count_of

UNUSABLE_SHARE = 0.98  # of a channel's samples on the sphere
BLOWN_SHARE = 0.05  # of the frame: from which clipping is named where no sphere is found
DARK = 0.01  # of white: below which darkness is named where no sphere is found
BLOCKS_PER_RADIUS = 24
BLOCK = 8  # samples a side, of the whole frame
INNER = 0.95  # of the radius: blocks further out mix with the background
UNEXPLAINED = 0.3  # of the shading's variance; a good photograph's light leaves 0.001 to 0.05, a wrong one 0.5 to 1
FAR_BETTER = 1 / 3  # what another single lamp must leave, of that, to contradict the lights given
NAMES = ("red", "green", "blue")


@contextmanager
def exposure_explains(whole: LinearImage) -> Iterator[None]:
    """Where no sphere is found in a photograph that is blown out or dark, say so."""
    try:
        yield
    except BadInputError as error:
        if not str(error).startswith("no sphere found"):
            raise  # one was seen and says itself what is wrong with it
        blown = count_of(whole, SampleFlag.CLIPPED) / sum(plane.flags.size for plane in whole.planes)
        blocks = _blocks(whole, BLOCK).values
        brightest = float(np.percentile(blocks.max(axis=2), 99.9)) if blocks.size else np.inf
        if blown > BLOWN_SHARE:
            raise BadInputError(
                f"no sphere found, and {100 * blown:.0f} % of the samples are clipped; expected a ball whose outline "
                "and shading can be seen: expose shorter, or give --sphere CX,CY,R"
            ) from error
        if brightest < DARK * min(whole.white, 1.0):
            raise BadInputError(
                f"no sphere found, and the photograph is dark: its brightest part is at {100 * brightest:.2g} % of "
                "white; expected a lit ball: expose longer, check lamp and lens cap, or give --sphere CX,CY,R"
            ) from error
        raise


def check_exposure(image: LinearImage, scene: Scene) -> None:
    """Raise BadInputError where the sphere is all clipped, all dark, or not lit by the lights given."""
    for channel, name in enumerate(NAMES):
        _check_usable([plane for plane in image.planes if plane.channel == channel], name, scene)
    side = max(int(scene.sphere.radius_px / image.planes[0].step_px / BLOCKS_PER_RADIUS), 1)
    blocks = _blocks(image, side)
    _check_contrast(blocks, scene)
    if scene.lights:  # none: they are estimated from the same shading
        _check_shading(blocks, scene)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blocks:
    """Means (h, w, 3) over square blocks of `side` samples, placed as in Plane, and the noise (3,) of a dark sample."""

    values: Floats
    origin_px: tuple[float, float]
    step_px: int
    side: int
    noise: Floats


def _blocks(image: LinearImage, side: int) -> Blocks:
    first = image.planes[0]
    rows = min(plane.values.shape[0] for plane in image.planes) // side
    columns = min(plane.values.shape[1] for plane in image.planes) // side
    values = np.zeros((rows, columns, 3))
    for channel in range(3):
        means = [_means(plane, rows, columns, side) for plane in image.planes if plane.channel == channel]
        values[..., channel] = np.mean(means, axis=0)
    middle = (first.step_px * side - 1) / 2  # of a block, from its first pixel
    origin = (first.origin_px[0] + middle, first.origin_px[1] + middle)
    return Blocks(
        values=values, origin_px=origin, step_px=first.step_px * side, side=side, noise=np.asarray(image.noise.read)
    )


def _means(plane: Plane, rows: int, columns: int, side: int) -> Floats:
    lines = plane.values[: rows * side, : columns * side].reshape(rows, side, columns * side).mean(axis=1)
    return np.asarray(lines.reshape(rows, columns, side).mean(axis=2), float)


def _check_usable(planes: list[Plane], name: str, scene: Scene) -> None:
    """Whether a channel's samples on the sphere are numbers below white."""
    if not any(plane.flags.any() for plane in planes):
        return
    flags = np.concatenate([_flags_on_sphere(plane, scene) for plane in planes])
    for kind, found, remedy in (
        (SampleFlag.CLIPPED, "clipped", "only the highlight's core clipped, if anything: expose shorter"),
        (SampleFlag.INVALID, "not finite", "numbers: write the image again"),
    ):
        share = np.count_nonzero(flagged(flags, kind)) / max(flags.size, 1)
        if share > UNUSABLE_SHARE:
            raise BadInputError(f"{100 * share:.0f} % of the sphere's {name} samples are {found}; expected {remedy}")


def _flags_on_sphere(plane: Plane, scene: Scene) -> NDArray[np.uint8]:
    x, y = _grid(plane.flags.shape, plane.origin_px, plane.step_px)
    return plane.flags[on_sphere(scene.camera, scene.sphere, x, y)]


def _grid(shape: tuple[int, ...], origin_px: tuple[float, float], step_px: int) -> tuple[Floats, Floats]:
    """Columns' x (w,) and rows' y (h, 1) of a grid's places, px."""
    return origin_px[0] + step_px * np.arange(shape[1]), origin_px[1] + step_px * np.arange(shape[0])[:, None]


def _check_contrast(blocks: Blocks, scene: Scene) -> None:
    """Whether the sphere's parts differ by more than noise: one sample's, or what chance does to blocks of few."""
    x, y = np.broadcast_arrays(*_grid(blocks.values.shape, blocks.origin_px, blocks.step_px))
    inner = blocks.values[surface(scene.camera, scene.sphere, x, y).offset2 < INNER**2]
    if not len(inner):
        return
    contrast = np.ptp(inner, axis=0)
    if np.all(contrast <= max(1.0, 8.0 / blocks.side) * blocks.noise):
        channel = int(np.argmax(contrast))
        raise BadInputError(
            f"the sphere is dark: its brightest and darkest parts differ by {contrast[channel]:.2g}, one sample's "
            f"noise is {blocks.noise[channel]:.2g}; expected a lit ball: expose longer, check lamp and lens cap"
        )


def _check_shading(blocks: Blocks, scene: Scene) -> None:
    """Whether the lights given cause the shading, where one lamp elsewhere would: a wrong direction, or another place.

    Only what is beyond doubt: a ball that no single lamp explains better may be textured, metal or under many lamps.
    """
    from toolkit.geometry.highlight import light_from_highlight, unexplained

    where: dict[str, Any] = {
        "sphere": scene.sphere,
        "camera": scene.camera,
        "origin_px": blocks.origin_px,
        "step_px": blocks.step_px,
    }
    left = unexplained(blocks.values, [light.direction for light in scene.lights], **where)
    if left < UNEXPLAINED:
        return
    try:
        other = light_from_highlight(blocks.values, **where).direction
    except BadInputError:
        return
    best = unexplained(blocks.values, [other], **where)
    if best < FAR_BETTER * left:
        given = " and ".join(written(light.direction) for light in scene.lights)
        raise BadInputError(
            f"light from {given} explains {100 * max(1 - left, 0):.0f} % of the sphere's shading, light from "
            f"{written(other)} would explain {100 * (1 - best):.0f} %; expected "
            "--light towards the lamp (x right, y up, z to the camera) and --sphere around the ball"
        )
