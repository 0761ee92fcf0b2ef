r"""Blinn-Phong: a highlight round the half vector, as the lecture writes it: (n.h)^n.

Phong's idea on the half vector: its highlights stretch towards grazing light as real ones do. About four times
Phong's exponent gives the same highlight in the plane of incidence. Like Phong it has no cosine and is no BRDF.

`normalisation=energy` is the reciprocal, energy conserving form: (n.h)^n n.l times
(n + 2)(n + 4) / (8 pi (2^(-n/2) + n)), which reflects everything at normal incidence (Giesen 2009, "Phong and
Blinn-Phong normalization factors").

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["blinn-phong"].value(facing, (200.0,))
    array([1.])
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from .cosines import Cosines, Number
from .lobe import Claim, Lobe, Parameter, register


def evaluate(cosines: Cosines, shininess: Number, *, normalisation: str = "lecture") -> Floats:
    """(n.h)^n, 0 behind either horizon."""
    value = np.exp(_log_cosine(cosines) * shininess) * _lit(cosines)
    if normalisation == "energy":
        value *= _normaliser(np.asarray(shininess))[0] * cosines.n_dot_l
    return np.asarray(value)


def gradient(cosines: Cosines, shininess: Number, *, normalisation: str = "lecture") -> tuple[Floats, ...]:
    """The value, and its derivative by shininess: the lobe times log(n.h), and the normaliser's own growth."""
    growth = _normaliser(np.asarray(shininess))[1] if normalisation == "energy" else 0.0
    value = evaluate(cosines, shininess, normalisation=normalisation)
    return value, value * (_log_cosine(cosines) + growth)


def _log_cosine(cosines: Cosines) -> Floats:
    """log(n.h), accurate where it is near 0."""
    below_one = 1.0 - float(np.finfo(cosines.sin2_h.dtype).epsneg)
    return np.asarray(0.5 * np.log1p(-np.minimum(cosines.sin2_h, below_one)))


def _lit(cosines: Cosines) -> NDArray[np.bool_]:
    return np.asarray((cosines.n_dot_v > 0.0) & (cosines.n_dot_l > 0.0))


def _normaliser(n: Floats) -> tuple[Floats, Floats]:
    """Giesen's normaliser, and the derivative of its logarithm."""
    rest = np.exp2(-0.5 * n)
    value = (n + 2.0) * (n + 4.0) / (8.0 * np.pi * (rest + n))
    return value, 1.0 / (n + 2.0) + 1.0 / (n + 4.0) - (1.0 - 0.5 * np.log(2.0) * rest) / (rest + n)


register(
    Lobe(
        name="blinn-phong",
        title="Blinn-Phong",
        kind="specular",
        colour="specular_albedo",
        parameters=(
            Parameter(
                name="shininess",
                unit="1",
                low=1.0,
                high=1e5,
                log=True,
                starts=(20.0, 150.0, 1000.0, 8000.0),
                typical="20 satin, 200 plastic, 4000 polished",
                meaning="exponent: facet angles have an sd of about 1 / sqrt(n) rad",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"(n \cdot h)^n",
        source="blinn1977",
        sharp_angle="half",
        variants={"normalisation": ("lecture", "energy")},
        claims=frozenset({Claim.BOUNDED_AT_GRAZING_VIEW}),
        variant_claims={("normalisation", "energy"): frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY})},
    )
)
