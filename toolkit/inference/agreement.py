"""Two answers to one question: layers by colour, which know no shape, and layers by shape, which know the lobe.

Known shape averages over the whole ball and separates grey bodies, too; but it stands on its lobe. Colour stands on the
angle between body and light, and on pixels that are matte. Each is wrong where the other's ground holds, so the two
are compared, and the one whose ground holds is preferred.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import Flag
from toolkit.records import Agreement, ColourLayers, Fit, Floats, ModelLayers

SURE_ANGLE_DEG = 10.0  # between body and light, below which 1 % noise leaves colour a fifth of the highlight
TILT_RAD = 0.02  # of the body's colour: by so much a mosaic, a lens's fringes, an error of black turn it unseen
DISAGREE = 0.5  # of the specular layer's rms: no wrong lobe explains as much, but a hue that varies over the body does
BLOCK = 4  # pixels across the squares whose means are compared
LIMB = 0.03  # of the sphere's box: so near to the outline blur and the quads' own size make colours of two places one
SIGNIFICANT_SDS = 4.0  # of what noise alone makes of their difference
DOUBTED = (Flag.POOR_FIT, Flag.STRUCTURED_RESIDUALS)  # without them the difference is colour's own trouble
NO_GROUND = (Flag.MATTE_LINE_BENT, Flag.POOR_FIT)  # of colour's own layers


def agreement(colours: ColourLayers | None, layers: ModelLayers, fit: Fit) -> Agreement:
    """Which layers to believe and why; `difference` is the rms of the specular layers' difference beyond colour's own
    noise, over the rms of the shape's layer.
    """
    if colours is None or Flag.COLOUR_CANNOT_SEPARATE in colours.flags:
        return Agreement(preferred="shape", reason="colour cannot separate here", difference=None, disagree=False)
    difference, plain = _difference(colours, layers)
    preferred, reason = _preferred(colours, fit, difference or 0.0)
    sound = colours.angle_deg >= SURE_ANGLE_DEG and not any(flag in colours.flags for flag in NO_GROUND)
    disagree = plain and sound and any(flag in fit.flags for flag in DOUBTED)
    return Agreement(preferred=preferred, reason=reason, difference=difference, disagree=disagree)


def _preferred(colours: ColourLayers, fit: Fit, difference: float) -> tuple[Literal["shape", "colour"], str]:
    if colours.angle_deg < SURE_ANGLE_DEG:
        return (
            "shape",
            f"body and light are {colours.angle_deg:.1f} degrees apart in colour: too close for colour alone",
        )
    if any(flag in colours.flags for flag in NO_GROUND):
        return "shape", "the colours show no plain matte line"
    if difference > DISAGREE:
        return "shape", "colour sees a highlight that no lobe leaves room for, as where the body's hue varies"
    if Flag.POOR_FIT in fit.flags:
        return "colour", "the lobes leave residuals far above the noise, and colour needs no lobe"
    return "shape", "the lobes describe the ball, and shape averages over all of it"


def _difference(colours: ColourLayers, layers: ModelLayers) -> tuple[float | None, bool]:
    """Relative rms of the difference of block means beyond noise, and whether it is plainly one.

    Plain is what noise does not explain, nor a slight turn of the body's colour: that shifts light between the layers
    by the turn over the sine of the angle between body and light.
    """
    light = np.asarray(colours.light_colour, np.float32)
    used = layers.used[..., 0] & layers.used[..., 1] & layers.used[..., 2]
    by_colour, by_shape = colours.along_light, _scalar(layers.specular, light)
    variance = colours.covariance[..., 2]
    both = _inner(np.isfinite(by_shape)) & np.isfinite(by_colour) & np.isfinite(variance) & used
    count = _blocks(both.astype(np.float32))
    with np.errstate(invalid="ignore"):  # blocks that hold what is not finite do not count
        apart, noise, shown = (_blocks(part) for part in (by_colour - by_shape, variance, by_shape))
    full = count == BLOCK**2
    power = float(np.mean(shown[full] ** 2)) if full.any() else 0.0
    if power <= 0.0:
        return None, False
    beyond = float(np.mean(apart[full] ** 2 - noise[full]))
    chance = SIGNIFICANT_SDS * float(np.sqrt(2.0 * np.sum(noise[full] ** 2))) / np.count_nonzero(full)
    plain = beyond > max(chance, DISAGREE**2 * power) and beyond > _turned(colours.angle_deg, layers.diffuse, full)
    return float(np.sqrt(max(beyond, 0.0) / power)), plain


def _turned(angle_deg: float, body: Floats, full: NDArray[np.bool_]) -> float:
    """Mean square over the blocks that are `full` of what a turn of the body's colour shifts to the light's layer."""
    matte = _blocks(np.sqrt(_scalar(body, body)))[full]
    return (TILT_RAD / float(np.sin(np.radians(angle_deg)))) ** 2 * float(np.mean(matte**2))


def _scalar(layer: Floats, other: Floats) -> Floats:
    """Scalar product of a layer's colours (h, w, 3) with one colour, or with another layer's."""
    return np.asarray(layer[..., 0] * other[..., 0] + layer[..., 1] * other[..., 1] + layer[..., 2] * other[..., 2])


def _blocks(layer: Floats) -> Floats:
    """Sums over squares of BLOCK pixels: what a quad's channels see at different places cancels in them."""
    height, width = (n // BLOCK * BLOCK for n in layer.shape)
    lines = layer[:height, :width].reshape(-1, BLOCK, width).sum(axis=1)
    return np.asarray(sum(lines[:, step::BLOCK] for step in range(BLOCK)), float)  # numpy sums short axes slowly


def _inner(ball: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The ball's disc less a rim."""
    import cv2

    rim = 2 * max(round(LIMB * max(ball.shape)), 1) + 1
    kept = cv2.erode(
        ball.astype(np.uint8), np.ones((rim, rim), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    return np.asarray(kept > 0)
