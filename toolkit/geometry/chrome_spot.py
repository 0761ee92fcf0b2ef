"""The lamp's image on a mirror ball, found roughly: the brightest compact place on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag, flagged
from toolkit.records import Camera, Floats, LinearImage, Sphere

from .sphere import surface

MIN_N_DOT_V = 0.12  # nearer to the limb a mirrored half space crowds into a few pixels
LEAST_CONTRAST = 4.0  # of the highlight's peak over what else the ball mirrors
LEAST_SIGMAS = 12.0  # of the peak over the noise
LARGEST = 0.15  # share of the ball's disc that a lamp's image may fill
ALL_CLIPPED = 0.5  # share of the ball's samples from which on nothing can be told
RIVAL = 0.5  # light of another such place, of the brightest's, from which on it is told of


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """Where a highlight is about, pixels, and how far it reaches; `rival`: another is nearly as bright."""

    x_px: float
    y_px: float
    radius_px: float
    rival: bool


def find_spot(image: LinearImage, *, sphere: Sphere, camera: Camera) -> Spot:
    """The brightest compact place of the ball; raises BadInputError where there is none that a lamp could be."""
    bright, clipped, (x, y), step = _together(image)
    seen = surface(camera, sphere, x.ravel(), y.ravel())
    facing = np.einsum("ni,ni->n", seen.normal, seen.view) > MIN_N_DOT_V
    inside = (seen.on_sphere & facing).reshape(bright.shape)
    _check_clipping(clipped, inside)
    _check_contrast(bright, inside, image, (x, y))
    labels, flux, area = _places(bright, inside)
    best = int(np.argmax(flux))
    if area[best] > LARGEST * inside.sum():
        raise BadInputError(
            f"no highlight on the ball: its brightest region fills {100 * area[best] / inside.sum():.0f} % of it; "
            "expected the small image of one lamp in a dark room"
        )
    weight = np.where(labels == best + 1, bright, 0.0)
    total = weight.sum()
    return Spot(
        x_px=float((weight * x).sum() / total),
        y_px=float((weight * y).sum() / total),
        radius_px=float(np.sqrt(area[best] / np.pi)) * step,
        rival=bool(np.sum(flux > RIVAL * flux[best]) > 1),
    )


def _together(image: LinearImage) -> tuple[Floats, NDArray[np.bool_], tuple[Floats, Floats], int]:
    """Mean of the planes (h, w), where any is clipped, pixel coordinates, and the step between them."""
    height = min(plane.values.shape[0] for plane in image.planes)
    width = min(plane.values.shape[1] for plane in image.planes)
    values = np.mean([plane.values[:height, :width] for plane in image.planes], axis=0)
    flags = np.bitwise_or.reduce([plane.flags[:height, :width] for plane in image.planes])
    origin, step = np.mean([plane.origin_px for plane in image.planes], axis=0), image.planes[0].step_px
    row, column = np.mgrid[:height, :width]
    values = np.where(flagged(flags, SampleFlag.INVALID), 0.0, values)
    return values, flagged(flags, SampleFlag.CLIPPED), (origin[0] + step * column, origin[1] + step * row), step


def _check_clipping(clipped: NDArray[np.bool_], inside: NDArray[np.bool_]) -> None:
    if not inside.any():
        raise BadInputError("the ball lies outside the frame; expected its circle in pixels: --sphere CX,CY,R")
    share = float(clipped[inside].mean())
    if share > ALL_CLIPPED:
        raise BadInputError(
            f"{100 * share:.0f} % of the ball is clipped; expected only the lamp's image to be so: expose less"
        )


def _check_contrast(
    bright: Floats, inside: NDArray[np.bool_], image: LinearImage, places: tuple[Floats, Floats]
) -> None:
    """A highlight stands out from what else the ball mirrors, and from the noise."""
    peak, level = float(bright[inside].max()), float(np.median(bright[inside]))
    noise = float(np.sqrt(np.mean([image.noise.variance(np.array(max(level, 0.0)), c) for c in range(3)])))
    if peak > max(LEAST_CONTRAST * level, level + LEAST_SIGMAS * noise):
        return
    outside = np.where(inside, -np.inf, bright)
    row, column = np.unravel_index(int(np.argmax(outside)), outside.shape)
    if outside[row, column] > LEAST_CONTRAST * max(peak, LEAST_SIGMAS * noise):
        x, y = places[0][row, column], places[1][row, column]
        raise BadInputError(
            f"the highlight, at ({x:.0f}, {y:.0f}), lies outside the ball's circle; "
            "expected it on the ball: correct --sphere CX,CY,R"
        )
    raise BadInputError(
        "no highlight on the ball: nothing on it stands out; expected the bright image of one lamp on a mirror ball"
    )


def _places(bright: Floats, inside: NDArray[np.bool_]) -> tuple[NDArray[np.int32], Floats, Floats]:
    """Connected places above half the peak: their labels, light and area in samples."""
    import cv2

    level = float(np.median(bright[inside]))
    shown = np.where(inside, bright - level, 0.0)
    smooth = cv2.GaussianBlur(shown, (0, 0), 0.8)
    _, labels = cv2.connectedComponents((smooth > 0.5 * smooth.max()).astype(np.uint8))
    flux = np.bincount(labels.ravel(), np.maximum(shown, 0.0).ravel())[1:]
    area = np.bincount(labels.ravel())[1:]
    return np.asarray(labels, np.int32), np.asarray(flux, float), np.asarray(area, float)
