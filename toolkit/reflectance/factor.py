"""One number for a body that does not depend on which lobe tells of it: its reflectance factor, lit at 45°, seen at 0°.

The colours of two diffuse lobes are two quantities: Lambert's is a share of all light, Wolff's a share of what went in
through the surface. Compared with a perfect white diffuser in the same light, seen from the same side, both are one:
what an instrument of the 45°:0° geometry reads of the body (ISO 13655, CIE 15).
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .lobe import Lobe

INCIDENCE_RAD = np.radians(45.0)


def reflectance_factor(lobe: Lobe, shape: tuple[Number, ...]) -> Floats:
    """Reflectance factor at 45°:0° of a diffuse lobe of colour 1, for shape numbers that broadcast: pi f."""
    normal = np.array([0.0, 0.0, 1.0])
    light = np.array([np.sin(INCIDENCE_RAD), 0.0, np.cos(INCIDENCE_RAD)])
    return np.asarray(np.pi * lobe.value(Cosines.of(normal, light, normal), shape) / light[2])
