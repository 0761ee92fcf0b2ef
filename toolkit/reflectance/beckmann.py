r"""Beckmann: facets that are small mirrors, their slopes Gaussian; Cook and Torrance's lobe.

For surfaces roughened by many small accidents: sand-blasted metal, ground glass, paint. The slopes of the sea are
Gaussian as well. alpha is sqrt(2) times the slopes' standard deviation along one axis. Its tail ends sooner than
that of `ggx`: where a highlight sits in a haze, compare the two.

`masking`: `smith` is Smith's G with Walter's rational G1 (within 6e-3 of the exact one), light's and view's
multiplied; `smith-correlated` knows that a high facet is seen by both; `v-groove` is Torrance and Sparrow's.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["beckmann"].value(facing, (0.1,)).round(3)
    array([7.958])
"""

from __future__ import annotations

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .distributions import beckmann, beckmann_derivative
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import MASKING, microfacet, microfacets


def evaluate(cosines: Cosines, alpha: Number, *, masking: str = "smith") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    return microfacet(cosines, beckmann(cosines, alpha) * g.masking(cosines, masking, g.BECKMANN, alpha))


def gradient(cosines: Cosines, alpha: Number, *, masking: str = "smith") -> tuple[Floats, ...]:
    """The value, and its derivative by alpha."""
    density, d_density = beckmann_derivative(cosines, alpha)
    seen, (d_seen,) = g.masking_derivatives(cosines, masking, g.BECKMANN, alpha)
    return microfacets(cosines, density * seen, d_density * seen + density * d_seen)


register(
    Lobe(
        name="beckmann",
        title="Beckmann (Cook-Torrance)",
        kind="specular",
        colour="specular_strength",
        parameters=(
            Parameter(
                name="alpha",
                unit="1",
                low=0.005,
                high=1.0,
                log=True,
                starts=(0.03, 0.1, 0.3, 0.6),
                typical="0.03 glossy paint, 0.15 satin, 0.4 ground glass",
                meaning="sqrt(2) x the standard deviation of the facets' slopes along one axis",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{G\, D(\theta_h)}{4\, n \cdot v}, \quad "
        r"D = \frac{e^{-\tan^2\theta_h / \alpha^2}}{\pi \alpha^2 \cos^4\theta_h}",
        source="cook1982",
        sharp_angle="half",
        fresnel=True,
        variants={"masking": MASKING},
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
