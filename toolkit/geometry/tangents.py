"""The plane across a direction."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats


def tangents(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that span the plane across a direction."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(helper, direction)
    across /= np.linalg.norm(across)
    return across, np.cross(direction, across)
