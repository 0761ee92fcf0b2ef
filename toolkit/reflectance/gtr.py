r"""GTR: facets that are small mirrors, with a free tail: gloss in a haze.

For lacquers, polished metals and plastics whose highlight has a sharp core and a skirt that no single width fits.
`tail` 2 is exactly `ggx`; towards 1 the skirt grows longer, above 2 it shortens and the core narrows with it (a
highlight of tail t is about as wide as a GGX of alpha sqrt(2 / t)).

`masking`: `smith` and `smith-correlated` take Smith's G1 of this very D, summed over its facets and tabulated, not
GGX's as the paper does, with which the longest tails would give back up to nine times the light at grazing.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["gtr"].value(facing, (0.1, 2.0)).round(3)
    array([7.958])
"""

from __future__ import annotations

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .distributions import gtr, gtr_derivatives
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import MASKING, microfacet, microfacets
from .smith import exact

SMITH = exact(gtr_derivatives)


def evaluate(cosines: Cosines, alpha: Number, tail: Number, *, masking: str = "smith") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    return microfacet(cosines, gtr(cosines, alpha, tail) * g.masking(cosines, masking, SMITH, alpha, tail))


def gradient(cosines: Cosines, alpha: Number, tail: Number, *, masking: str = "smith") -> tuple[Floats, ...]:
    """The value, and its derivatives by alpha and tail."""
    density, by_alpha, by_tail = gtr_derivatives(cosines, alpha, tail)
    seen, (seen_alpha, seen_tail) = g.masking_derivatives(cosines, masking, SMITH, alpha, tail)
    parts = density * seen, by_alpha * seen + density * seen_alpha, by_tail * seen + density * seen_tail
    return microfacets(cosines, *parts)


register(
    Lobe(
        name="gtr",
        title="GTR (generalised Trowbridge-Reitz, free tail)",
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
                typical="0.03 lacquer, 0.15 satin, 0.5 matte metal",
                meaning="width of the facets' slopes",
            ),
            Parameter(
                name="tail",
                unit="1",
                low=1.0,
                high=5.0,
                log=False,
                starts=(1.6, 3.0),
                typical="1.3 gloss in a haze, 2 GGX, 4 almost Gaussian",
                meaning="exponent of the tail: the smaller, the longer the skirt",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{G\, D(\theta_h)}{4\, n \cdot v}, \quad "
        r"D = \frac{(\gamma - 1)(\alpha^2 - 1)}{\pi (1 - \alpha^{2 (1 - \gamma)})} "
        r"\frac{1}{(1 + (\alpha^2 - 1) \cos^2\theta_h)^\gamma}",
        source="burley2012",
        sharp_angle="half",
        fresnel=True,
        variants={"masking": MASKING},
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
