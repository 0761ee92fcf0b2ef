r"""Torrance-Sparrow: facets that are small mirrors, their angles Gaussian; the lecture's physical lobe.

For paint, plastic, roughened metal and ceramics. Its highlight stretches at grazing light, and its peak moves
beyond the mirror direction as the light goes down ("off-specular peak"). It stays bounded as the view grazes under
a fixed light: G falls as fast as 1 / (n.v) grows. The lecture's closing form K exp(-theta_h^2 / (2 sigma^2)) F G /
(n.v) has K = E / (8 pi sigma^2) for small sigma.

`masking=smith` and `smith-correlated` use Beckmann's G1 at alpha = sqrt(2) sigma, the Gaussian of slopes that fits
a Gaussian of angles for small sigma; beyond about 0.3 rad they no longer conserve energy.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["torrance-sparrow"].value(facing, (0.1,)).round(3)
    array([4.032])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .distributions import gaussian, gaussian_derivative
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import microfacet

_ALPHA_PER_SIGMA = float(np.sqrt(2.0))


def evaluate(cosines: Cosines, roughness_rad: Number, *, masking: str = "v-groove") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    alpha = _ALPHA_PER_SIGMA * np.asarray(roughness_rad)
    seen = g.masking(cosines, masking, g.BECKMANN, alpha)
    return microfacet(cosines, gaussian(cosines, roughness_rad) * seen)


def gradient(cosines: Cosines, roughness_rad: Number, *, masking: str = "v-groove") -> tuple[Floats, ...]:
    """By roughness_rad."""
    alpha = _ALPHA_PER_SIGMA * np.asarray(roughness_rad)
    density, d_density = gaussian_derivative(cosines, roughness_rad)
    seen, d_seen = g.masking_derivative(cosines, masking, g.BECKMANN, alpha)
    return (microfacet(cosines, d_density * seen + density * d_seen * _ALPHA_PER_SIGMA),)


register(
    Lobe(
        name="torrance-sparrow",
        title="Torrance-Sparrow",
        kind="specular",
        colour="specular_strength",
        parameters=(
            Parameter(
                name="roughness_rad",
                unit="rad",
                low=0.005,
                high=0.8,
                log=True,
                starts=(0.02, 0.07, 0.2, 0.45),
                typical="0.02 glossy paint, 0.1 satin, 0.3 matte plastic",
                meaning="standard deviation of the facets' angles from the surface normal",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{G\, D(\theta_h)}{4\, n \cdot v}, \quad D = c\, e^{-\theta_h^2 / (2 \sigma^2)}, \quad "
        r"G = \min\left(1, \frac{2 (n \cdot h)(n \cdot v)}{v \cdot h}, "
        r"\frac{2 (n \cdot h)(n \cdot l)}{v \cdot h}\right)",
        source="torrance1967",
        sharp_angle="half",
        fresnel=True,
        variants={"masking": ("v-groove", "smith", "smith-correlated")},
        claims=frozenset({Claim.RECIPROCAL, Claim.BOUNDED_AT_GRAZING_VIEW}),
        variant_claims={("masking", "v-groove"): frozenset({Claim.CONSERVES_ENERGY})},
    )
)
