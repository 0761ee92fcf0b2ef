r"""Phong: a highlight round the mirrored light, as the lecture writes it: L = I rho_s (R.E)^n.

For comparison with what renderers did for decades. It is no BRDF: it has no cosine, is not reciprocal, and on a plane
its highlight stays round at grazing light where real ones stretch. For the same highlight its exponent is about a
quarter of Blinn's.

`normalisation=energy` is the reciprocal, energy conserving form: (n + 2) / (2 pi) (r.v)^n n.l (Lafortune &
Willems 1994, "Using the modified Phong reflectance model for physically based rendering").

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["phong"].value(facing, (50.0,))
    array([1.])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .lobe import Claim, Lobe, Parameter, register


def evaluate(cosines: Cosines, shininess: Number, *, normalisation: str = "lecture") -> Floats:
    """(r.v)^n, 0 behind either horizon."""
    value = np.exp(_log_cosine(cosines) * shininess) * _lit(cosines)
    if normalisation == "energy":
        value *= (np.asarray(shininess) + 2.0) / (2.0 * np.pi) * cosines.n_dot_l
    return np.asarray(value)


def gradient(cosines: Cosines, shininess: Number, *, normalisation: str = "lecture") -> tuple[Floats, ...]:
    """The value, and its derivative by shininess: the lobe times log(r.v), and the normaliser's own growth."""
    growth = 1.0 / (np.asarray(shininess) + 2.0) if normalisation == "energy" else 0.0
    value = evaluate(cosines, shininess, normalisation=normalisation)
    return value, value * (_log_cosine(cosines) + growth)


def _log_cosine(cosines: Cosines) -> Floats:
    return np.asarray(np.log(np.clip(cosines.r_dot_v, 1e-300, 1.0)))


def _lit(cosines: Cosines) -> Floats:
    return np.asarray((cosines.n_dot_v > 0.0) & (cosines.n_dot_l > 0.0) & (cosines.r_dot_v > 0.0), float)


register(
    Lobe(
        name="phong",
        title="Phong",
        kind="specular",
        colour="specular_albedo",
        parameters=(
            Parameter(
                name="shininess",
                unit="1",
                low=1.0,
                high=1e5,
                log=True,
                starts=(6.0, 40.0, 250.0, 2000.0),
                typical="5 satin, 50 plastic, 1000 polished",
                meaning="exponent: the highlight falls to 1/e at about sqrt(2 / n) rad from the mirrored light",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"(r \cdot v)^n, \quad r = 2 (n \cdot l) n - l",
        source="phong1975",
        sharp_angle="mirror",
        variants={"normalisation": ("lecture", "energy")},
        claims=frozenset({Claim.BOUNDED_AT_GRAZING_VIEW}),
        variant_claims={("normalisation", "energy"): frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY})},
    )
)
