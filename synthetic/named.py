"""Materials by name, with plausible numbers for renders; what each rests on is its `source`.

Bodies and roughness marked MERL follow the published ABC fits of measured materials (Low, Kronander, Ynnerman &
Unger 2012, "BRDF models for accurate and efficient rendering of glossy surfaces"): the albedo is pi x kD, and the
roughness is that of the Gaussian lobe that falls to half at the same angle. Their F0 is a clear polymer's 0.04.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .materials import Material, Number, material

# Johnson & Christy 1972, "Optical constants of the noble metals": n and k at 617, 549 and 451 nm
_METALS = {
    "gold": ((0.21, 0.43, 1.38), (3.272, 2.455, 1.914)),
    "silver": ((0.06, 0.06, 0.04), (4.152, 3.586, 2.657)),
    "copper": ((0.30, 1.02, 1.24), (3.205, 2.577, 2.397)),
}


def _polymer(name: str, roughness_rad: float, diffuse_albedo: Sequence[float]) -> Material:
    numbers: dict[str, Number] = {"roughness_rad": roughness_rad, "diffuse_albedo": diffuse_albedo, "specular_f0": 0.04}
    return material("torrance-sparrow", numbers, name=name, source="MERL")


def _metal(name: str, alpha: float) -> Material:
    n, k = (np.array(values) for values in _METALS[name])
    f0 = ((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2)
    numbers: dict[str, Number] = {"alpha": alpha, "diffuse_albedo": 0.0, "specular_f0": f0.tolist()}
    source = "F0: Johnson & Christy 1972 at 617, 549, 451 nm; alpha: sandblasted, chosen"
    return material("beckmann", numbers, variant={"masking": "smith"}, name=name, source=source)


_LISTED = (
    _polymer("red-plastic", 0.156, (0.842, 0.140, 0.034)),
    _polymer("dark-red-paint", 0.202, (0.791, 0.096, 0.029)),
    _polymer("yellow-matte-plastic", 0.0141, (0.913, 0.358, 0.062)),
    _polymer("nylon", 0.0226, (0.731, 0.730, 0.651)),
    _polymer("delrin", 0.0551, (0.932, 0.893, 0.776)),
    _polymer("pvc", 0.0197, (0.095, 0.107, 0.120)),
    _polymer("pearl-paint", 0.142, (0.571, 0.509, 0.430)),
    _metal("gold", 0.15),
    _metal("silver", 0.1),
    _metal("copper", 0.2),
    material(
        "ggx",
        {"alpha": 0.08, "diffuse_albedo": 0.0, "specular_index": 1.517},
        variant={"masking": "smith"},
        name="ground-black-glass",
        source="index of Schott N-BK7 at 588 nm; alpha: ground, chosen",
    ),
    material(
        "phong",
        {"shininess": 60.0, "diffuse_albedo": (0.55, 0.25, 0.12), "specular_albedo": 0.3},
        name="phong-ball",
        source="the lecture's form: L = I rho_s (R.E)^n, numbers chosen",
    ),
    material(
        "torrance-sparrow",
        {"roughness_rad": 0.12, "diffuse_albedo": (0.62, 0.16, 0.05), "specular_f0": 0.04},
        name="orange-plastic",
        source="the demo's ball; index 1.5 as of most polymers, the rest chosen",
    ),
)
MATERIALS: dict[str, Material] = {listed.name: listed for listed in _LISTED}
