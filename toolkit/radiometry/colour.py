"""From reflectances in a camera's channels to linear sRGB, as the DNG's colour tags describe the camera.

A reflectance is what a channel sees of the surface over what it sees of a perfect white in the same light, so white
balance is done already and white, (1, 1, 1), is to stay white. One matrix does the rest. For each illuminant under
which the maker calibrated the camera (Adobe, Digital Negative Specification 1.7, chapter 6):

- from a ForwardMatrix, made for white-balanced values: its rows scaled so that white becomes D50, D50 adapted to D65;
- else from the ColorMatrix (XYZ to camera): balanced values times the camera's response to that illuminant's white,
  through the inverse matrix to XYZ, and that white adapted to D65. Both by Bradford's transform.

Between two calibrations the matrices are interpolated by the reciprocal of the light's colour temperature.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from toolkit.records import CameraColour, Floats, Metadata

# IEC 61966-2-1: linear sRGB from CIE XYZ; whites of the 2 degree observer as XYZ with Y = 1
XYZ_TO_SRGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
D65 = np.array([0.95047, 1.0, 1.08883])
D50 = np.array([0.96422, 1.0, 0.82521])
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
ILLUMINANTS = {  # EXIF LightSource: correlated colour temperature in kelvin, chromaticity x, y (CIE 15)
    17: (2856.0, 0.44757, 0.40745),  # standard illuminant A
    18: (4874.0, 0.34842, 0.35161),
    19: (6774.0, 0.31006, 0.31616),
    20: (5503.0, 0.33242, 0.34743),  # D55
    21: (6504.0, 0.31270, 0.32900),  # D65
    22: (7504.0, 0.29903, 0.31488),
    23: (5003.0, 0.34567, 0.35850),  # D50
}
ALIKE = {1: 20, 3: 17, 4: 20, 9: 20, 10: 21, 11: 22, 24: 17}  # daylight, tungsten, flash, cloudy, shade, studio lamp
ASSUMED = 21  # where the file does not say under which light its matrix was measured
WORST_CONDITION = 100.0  # a matrix beyond it is no camera's
_ROUNDS = 20


class Calibration(NamedTuple):
    """One illuminant's matrices."""

    kelvin: float
    to_srgb: Floats  # of reflectances
    xyz_to_camera: Floats


def camera_colour(metadata: Metadata, *, light: Floats | None = None) -> CameraColour | None:
    """The camera as its file describes it; None where that has no usable matrix.

    `light` (3,) is the light's colour in camera channels, any length: it chooses between two calibrations. Without
    it the one nearer to D65 counts, under which the answer is wanted.
    """
    found = _calibrations(metadata)
    if not found:
        return None
    source: Literal["forward-matrix", "colour-matrix"] = (
        "forward-matrix" if metadata.forward_matrix else "colour-matrix"
    )
    share = _share_of_second(found, light)
    return CameraColour(to_srgb=(1 - share) * found[0].to_srgb + share * found[-1].to_srgb, source=source)


def to_xyz(colour: CameraColour) -> Floats:
    """The matrix (3, 3) from the same reflectances to CIE XYZ under D65, white at Y = 1."""
    return np.asarray(np.linalg.solve(XYZ_TO_SRGB, colour.to_srgb))


def adaptation(white: Floats, to: Floats) -> Floats:
    """Bradford's matrix (3, 3) from colours under one white (3,) XYZ to those under another."""
    return np.asarray(np.linalg.solve(BRADFORD, (BRADFORD @ to / (BRADFORD @ white))[:, None] * BRADFORD))


def _calibrations(metadata: Metadata) -> list[Calibration]:
    """One or two, in the file's order."""
    codes = (*metadata.calibration_illuminants, ASSUMED, ASSUMED)
    colour = (metadata.xyz_to_camera, metadata.xyz_to_camera_2)
    forward = (metadata.forward_matrix, metadata.forward_matrix_2)
    made = [_calibration(*each) for each in zip(codes, colour, forward, strict=False)]
    return [each for each in made if each is not None]


def _calibration(code: int, colour: object, forward: object) -> Calibration | None:
    kelvin, x, y = ILLUMINANTS[ALIKE.get(code, code) if ALIKE.get(code, code) in ILLUMINANTS else ASSUMED]
    white = np.array([x / y, 1.0, (1 - x - y) / y])
    xyz_to_camera, balanced_to_d50 = _matrix(colour), _matrix(forward)
    if xyz_to_camera is None:
        return None
    response = xyz_to_camera @ white
    if response.min() <= 0.0:
        return None
    if balanced_to_d50 is not None and (balanced_to_d50.sum(axis=1) > 0.0).all():
        to_xyz = adaptation(D50, D65) @ (balanced_to_d50 * (D50 / balanced_to_d50.sum(axis=1))[:, None])
    else:
        to_xyz = adaptation(white, D65) @ np.linalg.inv(xyz_to_camera) * response
    return Calibration(kelvin, XYZ_TO_SRGB @ to_xyz, xyz_to_camera)


def _matrix(rows: object) -> Floats | None:
    matrix = np.asarray(rows, float)
    usable = matrix.shape == (3, 3) and np.isfinite(matrix).all() and np.linalg.cond(matrix) <= WORST_CONDITION
    return matrix if usable else None


def _share_of_second(found: list[Calibration], light: Floats | None) -> float:
    """How much the second of two calibrations counts for this light, 0 to 1."""
    first, second = found[0], found[-1]
    if first.kelvin == second.kelvin:
        return 0.0
    nearer = float(abs(second.kelvin - 6504.0) < abs(first.kelvin - 6504.0))
    if light is None:
        return nearer
    share = nearer
    for _ in range(_ROUNDS):  # the light's XYZ depends on the matrix that its temperature chooses
        matrix = (1 - share) * first.xyz_to_camera + share * second.xyz_to_camera
        kelvin = temperature(np.linalg.solve(matrix, np.asarray(light, float)))
        if kelvin is None:
            return nearer
        share = float(np.clip((1 / kelvin - 1 / first.kelvin) / (1 / second.kelvin - 1 / first.kelvin), 0.0, 1.0))
    return share


def temperature(xyz: Floats) -> float | None:
    """Correlated colour temperature in kelvin (McCamy 1992, good to 2 K from 2856 to 6504 K); None for no light's."""
    if not xyz.min() > 0.0:
        return None
    x, y = xyz[:2] / xyz.sum()
    if not (0.24 < x < 0.60 and 0.24 < y < 0.46):  # the locus runs from (0.25, 0.25) to (0.58, 0.40), 1500 K
        return None
    n = (x - 0.3320) / (0.1858 - y)
    kelvin = 449.0 * n**3 + 3525.0 * n**2 + 6823.3 * n + 5520.33
    return float(kelvin) if 1000.0 < kelvin < 40_000.0 else None
