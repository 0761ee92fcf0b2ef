"""How the ball fills the camera's range: clipping, headroom, and by how much a clipped highlight is over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag, flagged
from toolkit.geometry.sphere import on_sphere
from toolkit.radiometry.quads import quads
from toolkit.records import Floats, LinearImage, Plane, Scene

from .records import Exposure
from .samples import Ball

ALONE = 4.0  # times above all that is beside it: a hot pixel
WIDTHS_RAD = np.geomspace(0.01, 0.5, 40)  # of highlights tried
REACH, REACH_RAD = 2.5, 0.06  # of a clipped core's radius, and beyond: its flanks, before the body's shading weighs
CORE_RAD = 0.45  # of a clipped region's radius: a larger one is body, and hides its highlight
AT_TOP = 0.97  # of a channel's greatest value: clipped in that channel
MOST_STOPS = 6.0  # beyond it what is left tells nothing
FEWEST, MOST = 50, 6000  # pixels that a height is told from


def exposure_of(image: LinearImage, scene: Scene | None, ball: Ball | None) -> Exposure:
    """Of the ball where there is one, else of the frame."""
    values = [_values(image, scene, channel) for channel in range(3)]
    peak = _peak(image, scene)
    body = _body(values, ball)
    noise = [float(np.sqrt(image.noise.variance(np.asarray(body[c]), c))) for c in range(3)]
    ceiling = np.isfinite(image.white)
    share = np.array([clipped.mean() for _, clipped in values])
    cut = ball is not None and ceiling and bool(ball.clipped.any())
    lost, at_least = _lost(ball, image.white) if ball is not None and cut else (None, False)
    return Exposure(
        of="frame" if ball is None else "ball",
        clipped_share=share,
        body=body,
        peak=peak,
        snr=body / np.maximum(noise, 1e-12),
        headroom_stops=np.log2(image.white / np.maximum(peak, 1e-9)) if ceiling else None,
        lost_stops=lost,
        lost_at_least=at_least,
    )


def samples_of(image: LinearImage, scene: Scene | None, channel: int) -> Floats:
    """All good samples (N,) of a channel on the ball, or in the frame."""
    return _values(image, scene, channel)[0]


def _values(image: LinearImage, scene: Scene | None, channel: int) -> tuple[Floats, NDArray[np.bool_]]:
    """All samples of a channel on the ball, or in the frame, and which of them clip."""
    found = [_of_plane(plane, scene) for plane in image.planes if plane.channel == channel]
    values, flags = (np.concatenate(part) for part in zip(*found, strict=True))
    good = ~flagged(flags, SampleFlag.INVALID)
    return values[good], flagged(flags[good], SampleFlag.CLIPPED)


def _of_plane(plane: Plane, scene: Scene | None) -> tuple[Floats, NDArray[np.uint8]]:
    if scene is None:
        return plane.values.ravel(), plane.flags.ravel()
    x = plane.origin_px[0] + plane.step_px * np.arange(plane.values.shape[1])
    y = plane.origin_px[1] + plane.step_px * np.arange(plane.values.shape[0])
    on = on_sphere(scene.camera, scene.sphere, x[None, :], y[:, None])
    return plane.values[on], plane.flags[on]


def _peak(image: LinearImage, scene: Scene | None) -> Floats:
    """The brightest of each channel (3,): of a small highlight, too, but not a hot pixel.

    A sample is hot that stands alone: far above its neighbours in its own plane and above the other channels there.
    """
    import cv2

    picture = quads(image)
    values = np.where(flagged(picture.flags, SampleFlag.INVALID)[..., None], np.float32(0.0), picture.values)
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    beside = cv2.dilate(values, ring)
    others = np.stack([np.max(np.delete(values, channel, axis=2), axis=2) for channel in range(3)], axis=2)
    counts = values <= ALONE * np.maximum(np.maximum(beside, others), 0.0)
    if scene is not None:
        x = picture.origin_px[0] + picture.step_px * np.arange(values.shape[1])
        y = picture.origin_px[1] + picture.step_px * np.arange(values.shape[0])
        counts &= on_sphere(scene.camera, scene.sphere, x[None, :], y[:, None])[..., None]
    return np.asarray(np.where(counts, values, 0.0).max(axis=(0, 1)), float)


def _body(values: list[tuple[Floats, NDArray[np.bool_]]], ball: Ball | None) -> Floats:
    if ball is None:
        return np.array([float(np.median(samples)) if samples.size else 0.0 for samples, _ in values])
    chosen = ball.lit & ~ball.clipped if (ball.lit & ~ball.clipped).any() else ball.lit
    return np.asarray(np.median(ball.value[chosen], axis=0))


def _lost(ball: Ball, white: float) -> tuple[float, bool]:
    """By how many stops the brightest exceeds white in any channel, and whether that is but a lower bound."""
    found = [_top(ball, channel) for channel in range(3)]
    top, at_least = max(top for top, _ in found), any(bound for _, bound in found)
    return float(np.clip(np.log2(max(top, white) / white), 0.0, MOST_STOPS)), at_least


def _top(ball: Ball, channel: int) -> tuple[float, bool]:
    """The height of a channel's clipped part, and whether only its body tells it; (0, False) where none clips.

    What is not clipped is explained by the body's cosine, a constant and one lobe about the clipped region's middle,
    Gaussian or GGX, of the width that leaves least. Where the region is too large for a highlight, the body itself
    clips, and its cosine alone is told.
    """
    value = ball.value[:, channel]
    clipped = ball.clipped & (value > AT_TOP * value.max())
    if np.count_nonzero(clipped) < 2:
        return 0.0, False
    middle = ball.normal[clipped].mean(axis=0)
    middle /= np.linalg.norm(middle)
    angle = np.arccos(np.clip(ball.normal @ middle, -1.0, 1.0))
    radius = float(np.quantile(angle[clipped], 0.9))
    core = radius < CORE_RAD
    use = np.flatnonzero(~clipped & (ball.cosine > 0.05) & ((angle < REACH * radius + REACH_RAD) if core else True))
    if len(use) < FEWEST:
        return 0.0, True
    use = use[:: max(len(use) // MOST, 1)]
    top = _height(angle[use], ball.cosine[use], value[use], float(ball.cosine[clipped].max()), lobes=core)
    return top, not core


def _height(angle: Floats, cosine: Floats, value: Floats, cosine_there: float, *, lobes: bool) -> float:
    """What the model that leaves least has in the middle; without `lobes` the body's alone."""
    from scipy.optimize import nnls

    weight = 1.0 / (0.02 * np.abs(value) + 0.01 * float(np.median(np.abs(value))) + 1e-9)
    body = np.stack([cosine, np.ones_like(cosine)], axis=1)
    if not lobes:
        return float(nnls(body * weight[:, None], value * weight)[0] @ (cosine_there, 1.0))
    best, top = np.inf, 0.0
    for width in WIDTHS_RAD:
        for lobe in (np.exp(-0.5 * (angle / width) ** 2), (1.0 + (np.tan(angle) / width) ** 2) ** -2.0):
            columns = np.column_stack([body, lobe])
            found, left = nnls(columns * weight[:, None], value * weight)
            if left < best:
                best, top = left, float(found @ (cosine_there, 1.0, 1.0))
    return top
