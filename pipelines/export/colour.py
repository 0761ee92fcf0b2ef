"""From the camera's red, green and blue to linear sRGB, where the file carries the camera's matrix."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats, Metadata

# IEC 61966-2-1: linear sRGB from CIE XYZ, and the chromaticity of D65 as XYZ with Y = 1
XYZ_TO_SRGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
D65 = np.array([0.95047, 1.0, 1.08883])
WORST_CONDITION = 100.0  # a matrix beyond it is no camera's


def reflectance_matrix(metadata: Metadata) -> Floats | None:
    """The (3, 3) matrix from reflectance a camera channel to linear sRGB reflectance; None where none is known.

    A perfect white, (1, 1, 1) in the camera's channels, is (1, 1, 1) in sRGB: reflectances are already divided by
    the light. Follows the DNG specification's ColorMatrix1 (XYZ to camera), taken as if measured under D65.
    """
    matrix = np.asarray(metadata.xyz_to_camera, float)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or np.linalg.cond(matrix) > WORST_CONDITION:
        return None
    white = matrix @ D65
    if white.min() <= 0.0:
        return None
    return np.asarray(XYZ_TO_SRGB @ np.linalg.inv(matrix) * white)


def srgb_encode(linear: Floats) -> Floats:
    """Linear sRGB, clipped to 0 .. 1, through the sRGB curve (IEC 61966-2-1)."""
    clipped = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * np.power(np.maximum(clipped, 1e-9), 1 / 2.4) - 0.055)


def srgb_hex(linear: Floats) -> str:
    """Linear sRGB as #rrggbb."""
    r, g, b = np.round(255 * srgb_encode(np.asarray(linear, float))).astype(int)
    return f"#{r:02x}{g:02x}{b:02x}"
