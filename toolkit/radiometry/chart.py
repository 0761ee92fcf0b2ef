"""A camera's colours from a photograph of a 24-patch chart (ColorChecker Classic, Passport) in the ball's light.

OpenCV's mcc module finds the chart; its patches' means, over a perfect white's in the same light, are reflectances in
camera channels. A matrix with white to white takes them to the patches' published colours (the average of charts in
colour-science, adapted from D50 to D65) by least squares in XYZ over white. It says itself how good it is: the mean
CIEDE2000 of each patch by the matrix of the 23 others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.radiometry.colour import D65, XYZ_TO_SRGB, adaptation
from toolkit.records import CameraColour, Floats, readonly

REFERENCE = "BabelColor Average"
NEUTRAL = (18, 19, 20)  # the brightest greys: where white is read off
INNER = 0.7  # share of a patch's side that is averaged: blur and frame stay outside
FEWEST = 9  # pixels a patch
WORST_DELTA_E = 10.0  # what is further off was no chart, or several lights
_DETECTION_PX = 1600  # longest side that is searched
_MOST_CLIPPED = 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chart:
    """Mean radiance (24, 3) of the patches, dark skin first, and their corners (24, 4, 2) in the picture's pixels."""

    patches: Floats
    corners: Floats

    def __post_init__(self) -> None:
        readonly(self)


def find_chart(picture: Floats, usable: NDArray[np.bool_]) -> Chart:
    """The chart in a linear picture (h, w, 3); `usable` (h, w) is false where a sample is clipped or invalid.

    Raises BadInputError where there is none, it is too small, or clips.
    """
    corners = _corners(picture)
    inner = corners.mean(axis=1, keepdims=True) + INNER * (corners - corners.mean(axis=1, keepdims=True))
    return Chart(patches=np.array([_mean(picture, usable, quad) for quad in inner]), corners=corners)


def colour_of_chart(chart: Chart) -> CameraColour:
    """The camera's matrix, and the light's colour, `white`.

    Raises BadInputError where the patches do not have a chart's colours.
    """
    reference = reference_xyz()
    white = white_of(chart.patches[list(NEUTRAL)], reference[list(NEUTRAL)])
    delta_e = float(leave_one_out(chart.patches, reference).mean())
    if not delta_e < WORST_DELTA_E:
        raise BadInputError(
            f"the chart's patches miss their colours by {delta_e:.1f} CIEDE2000 on average, expected below "
            f"{WORST_DELTA_E:.0f}: light it by the ball's lamp alone, without gloss or shadow"
        )
    to_xyz = reflectance_to_xyz(chart.patches / white, reference)
    return CameraColour(to_srgb=XYZ_TO_SRGB @ to_xyz, source="chart", delta_e=delta_e, white=white)


def colour_science() -> Any:  # noqa: ANN401  # it ships no types
    """The module `colour`; importing it changes how numpy prints arrays, which is undone."""
    with np.printoptions():
        import colour

    return colour


def reference_xyz() -> Floats:
    """The patches' published XYZ (24, 3) under D65, a perfect white at Y = 1."""
    colour = colour_science()
    chart = colour.CCS_COLOURCHECKERS[REFERENCE]
    measured = colour.xyY_to_XYZ(np.array(list(chart.data.values())))
    return np.asarray(measured @ adaptation(colour.xy_to_XYZ(chart.illuminant), D65).T)


def white_of(patches: Floats, reference: Floats) -> Floats:
    """What a perfect white would give (3,), from the brightest greys, weighted by their brightness.

    Printed greys are a little warm: each channel expects of them what the nearest of sRGB's would see.
    """
    expected = reference @ XYZ_TO_SRGB.T
    return np.asarray((patches * expected).sum(axis=0) / (expected * expected).sum(axis=0))


def reflectance_to_xyz(reflectances: Floats, reference: Floats) -> Floats:
    """The matrix (3, 3) of least squares that takes (1, 1, 1) to D65."""
    target = reference / D65
    differences = reflectances[:, :2] - reflectances[:, 2:]
    solved = np.linalg.lstsq(differences, target - reflectances[:, 2:], rcond=None)[0].T
    return np.asarray(D65[:, None] * np.column_stack([solved, 1.0 - solved.sum(axis=1)]))


def leave_one_out(patches: Floats, reference: Floats) -> Floats:
    """CIEDE2000 (24,) of each patch by the matrix and the white of all others."""
    return np.array([_left_out(patches, reference, one) for one in range(len(patches))])


def _left_out(patches: Floats, reference: Floats, one: int) -> float:
    colour = colour_science()
    others = np.arange(len(patches)) != one
    greys = [grey for grey in NEUTRAL if grey != one]
    white = white_of(patches[greys], reference[greys])
    found = reflectance_to_xyz(patches[others] / white, reference[others]) @ (patches[one] / white)
    d65 = D65[:2] / D65.sum()
    seen, wanted = (colour.XYZ_to_Lab(np.maximum(xyz, 0.0), d65) for xyz in (found, reference[one]))
    return float(colour.delta_E(seen, wanted, method="CIE 2000"))


def _corners(picture: Floats) -> Floats:
    """Corners (24, 4, 2) of the patches in the picture's pixels."""
    import cv2

    height, width = picture.shape[:2]
    shrink = max(1.0, max(height, width) / _DETECTION_PX)
    small = cv2.resize(np.ascontiguousarray(picture, np.float32), (round(width / shrink), round(height / shrink)),
                       interpolation=cv2.INTER_AREA)  # fmt: skip
    bright = np.maximum(np.percentile(small.reshape(-1, 3), 99.5, axis=0), 1e-9)
    shown = (255 * np.clip(small / bright, 0.0, 1.0) ** (1 / 2.2)).astype(np.uint8)
    detector: Any = cv2.mcc.CCheckerDetector.create()
    detector.setColorChartType(cv2.mcc.MCC24)
    if not detector.process(np.ascontiguousarray(shown[..., ::-1]), 1):
        raise BadInputError(
            "no 24-patch colour chart found; expected a ColorChecker, all its patches in view, filling a tenth of the "
            "frame or more"
        )
    found = np.array(detector.getBestColorChecker().getColorCharts(), float).reshape(-1, 4, 2)
    return np.asarray((found + 0.5) * (np.array([width, height]) / shown.shape[1::-1]) - 0.5)


def _mean(picture: Floats, usable: NDArray[np.bool_], quad: Floats) -> Floats:
    """Mean radiance (3,) within a quadrangle."""
    import cv2

    mask = np.zeros(picture.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, np.round(quad * 16).astype(np.int32), 1, shift=4)
    inside = mask > 0
    count = np.count_nonzero(inside)
    if count < FEWEST:
        raise BadInputError(
            f"the chart's patches are {count} px large; expected {FEWEST} or more: photograph it larger"
        )
    if np.count_nonzero(inside & ~usable) > _MOST_CLIPPED * count:
        raise BadInputError("a patch of the chart is clipped; expected none: shorten the exposure")
    return np.asarray(picture[inside & usable].mean(axis=0, dtype=float))
