"""The light's colour from the residual of the known shape: what is left of a ball once its body's shading is known.

A dielectric's interface reflects all wavelengths alike, so the highlight has the light's colour whatever the body's
(Shafer 1985, the dichromatic model). Where no irradiance is given a fit's specular numbers are the light's colour times
one number; unlike what colour alone finds, they need neither matte pixels nor a highlight on an even ground.
"""

from __future__ import annotations

import numpy as np

from toolkit.flags import Flag
from toolkit.records import Fit, Floats
from toolkit.separation.illuminant import Illuminant

WORST_DEG = 3.0  # stated error beyond which colour's own ways are heard instead
LEAST_BODY = 0.02  # of the specular numbers: with less body than that it is a metal, whose highlight has its own colour
UNSEEN = (Flag.NO_SPECULAR, Flag.HIGHLIGHT_UNSEEN)


def light_colour(fit: Fit) -> Illuminant | None:
    """The light's unit colour (3,) with the covariance of the fit's own posterior.

    None where the fit cannot tell: an irradiance was given, the specular colour was held neutral, the surface is a
    metal, no highlight stands out, or the error exceeds 3 degrees.
    """
    draws = _specular_draws(fit)
    if draws is None or fit.scene.scale == "absolute" or any(flag in fit.flags for flag in UNSEEN):
        return None
    if float(np.max(fit.colours["diffuse_albedo"])) < LEAST_BODY * float(np.max(draws.mean(axis=0))):
        return None
    unit = draws / np.maximum(np.linalg.norm(draws, axis=1, keepdims=True), 1e-300)
    mean = unit.mean(axis=0)
    if np.ptp(unit, axis=1).max() == 0.0 or not np.all(mean > 0):  # equal by decree, or no light's colour
        return None
    found = Illuminant(
        colour=mean / np.linalg.norm(mean),
        covariance=np.cov(unit.T),
        source="shape",
        reason="the highlight that known shape leaves",
    )
    return found if found.sd_deg < WORST_DEG else None


def _specular_draws(fit: Fit) -> Floats | None:
    """Posterior draws (N, 3) of the specular numbers; None of a fit that was not sampled."""
    for name in ("specular_strength", "specular_albedo"):
        if name in fit.draws:
            brought = fit.scene.lights[0].irradiance or (1.0, 1.0, 1.0)  # to one scale with a joint fit's others
            return np.asarray(np.asarray(fit.draws[name], float).reshape(-1, 3) * brought)
    return None
