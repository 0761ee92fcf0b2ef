r"""Torrance-Sparrow: facets that are small mirrors, their angles Gaussian; the lecture's physical lobe.

For paint, plastic, roughened metal and ceramics. Its highlight stretches at grazing light, and its peak moves
beyond the mirror direction as the light goes down ("off-specular peak"). It stays bounded as the view grazes under
a fixed light: G falls as fast as 1 / (n.v) grows. The lecture's closing form K exp(-theta_h^2 / (2 sigma^2)) F G /
(n.v) has K = E / (8 pi sigma^2) for small sigma.

`masking=v-groove` is the lecture's. `smith` and `smith-correlated` take Smith's G1 of this very D, summed over its
facets and tabulated.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["torrance-sparrow"].value(facing, (0.1,)).round(3)
    array([4.032])
"""

from __future__ import annotations

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .distributions import gaussian, gaussian_derivative
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import microfacet, microfacets
from .smith import exact

SMITH = exact(gaussian_derivative)


def evaluate(cosines: Cosines, roughness_rad: Number, *, masking: str = "v-groove") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    return microfacet(cosines, gaussian(cosines, roughness_rad) * g.masking(cosines, masking, SMITH, roughness_rad))


def gradient(cosines: Cosines, roughness_rad: Number, *, masking: str = "v-groove") -> tuple[Floats, ...]:
    """The value, and its derivative by roughness_rad."""
    density, d_density = gaussian_derivative(cosines, roughness_rad)
    seen, (d_seen,) = g.masking_derivatives(cosines, masking, SMITH, roughness_rad)
    return microfacets(cosines, density * seen, d_density * seen + density * d_seen)


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
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
