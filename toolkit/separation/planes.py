"""The light's colour from two or more bodies: it lies in the plane of each, so where the planes meet.

Lee 1986, "Method for computing the scene-illuminant chromaticity from specular highlights"; Tominaga & Wandell 1989.
Each plane counts by how well its own highlight fixes it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.records import Floats, Noise

from .illuminant import Illuminant, unit_colour
from .plane import DichromaticPlane, dichromatic_plane
from .samples import Mask, block_size, blocks, samples

APART = 40.0  # chi squared of the planes being one and the same, below which they are
WORST_DEG = 20.0


def common_line(
    picture: Floats,
    labels: NDArray[np.integer],
    *,
    variance: Floats | Noise,
    usable: Mask | None = None,
    bloom: Mask | None = None,
) -> Illuminant:
    """Where the colour planes of several bodies meet; `labels` (h, w) names the body of each pixel, below 0 none.

    Raises BadInputError where fewer than two bodies show a plane, or where their planes do not meet in one line
    within 20 degrees: bodies of one hue.
    """
    planes = []
    for label in np.unique(labels[labels >= 0]):
        ready = samples(picture, variance=variance, usable=usable, bloom=bloom, on_sphere=labels == label)
        plane = dichromatic_plane(blocks(ready, block_size(ready)))
        if plane is not None:
            planes.append(plane)
    if len(planes) < 2:
        raise BadInputError(f"{len(planes)} bodies show a highlight on a coloured body; planes need two of them")
    return _meet(planes)


def _meet(planes: list[DichromaticPlane]) -> Illuminant:
    """Weighted least squares for the unit vector at right angles to all normals."""
    normals = np.array([plane.normal for plane in planes])
    line = np.linalg.svd(normals)[2][2]
    for _ in range(3):
        variance = np.array([line @ plane.covariance @ line for plane in planes])
        information = (normals / np.maximum(variance, 1e-300)[:, None]).T @ normals
        values, axes = np.linalg.eigh(information)
        line = axes[:, 0]
    line = line * (np.sign(line.sum()) or 1.0)
    spread = (axes[:, 1:] / np.maximum(values[1:], 1e-300)) @ axes[:, 1:].T
    off = np.sqrt(((normals @ line) ** 2 / np.maximum(variance, 1e-300)).sum() / max(len(planes) - 2, 1))
    spread = spread * (max(off, 1.0) ** 2 if len(planes) > 2 else 1.0)
    apart = sum(
        float(plane.normal @ axes[:, 1]) ** 2 / float(axes[:, 1] @ plane.covariance @ axes[:, 1]) for plane in planes
    )
    if apart < APART or np.sqrt(np.trace(spread)) > np.radians(WORST_DEG) or np.any(line < -0.05):
        raise BadInputError("the bodies' colour planes do not meet in one line; expected bodies of different hue")
    return Illuminant(
        colour=unit_colour(np.maximum(line, 0.0)),
        covariance=spread,
        source="planes",
        reason=f"the colour planes of {len(planes)} bodies meet there",
    )
