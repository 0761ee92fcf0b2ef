"""The plane across a direction."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats


def tangents(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that span the plane across a direction."""
    x, y, z = direction
    across = np.array([z, 0.0, -x] if abs(y) < 0.9 else [0.0, -z, y])  # the y or the x axis x direction
    across /= np.sqrt(across @ across)
    return across, np.array(
        [y * across[2] - z * across[1], z * across[0] - x * across[2], x * across[1] - y * across[0]]
    )
