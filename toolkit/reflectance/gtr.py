r"""GTR: facets that are small mirrors, with a free tail: gloss in a haze.

For lacquers, polished metals and plastics whose highlight has a sharp core and a skirt that no single width fits.
`tail` 2 is exactly `ggx`; towards 1 the skirt grows longer, above 2 it shortens and the core narrows with it (a
highlight of tail t is about as wide as a GGX of alpha sqrt(2 / t)).

`masking`: `smith` and `smith-correlated` take GGX's G1, as the paper does, exact at tail 2 only: with long tails
they let too much light out at grazing, so only `v-groove` claims to conserve energy.

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
from .microfacet import MASKING, microfacet


def evaluate(cosines: Cosines, alpha: Number, tail: Number, *, masking: str = "smith") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    return microfacet(cosines, gtr(cosines, alpha, tail) * g.masking(cosines, masking, g.GGX, alpha))


def gradient(cosines: Cosines, alpha: Number, tail: Number, *, masking: str = "smith") -> tuple[Floats, ...]:
    """By alpha and tail."""
    density, by_alpha, by_tail = gtr_derivatives(cosines, alpha, tail)
    seen, d_seen = g.masking_derivative(cosines, masking, g.GGX, alpha)
    return microfacet(cosines, by_alpha * seen + density * d_seen), microfacet(cosines, by_tail * seen)


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
        claims=frozenset({Claim.RECIPROCAL, Claim.BOUNDED_AT_GRAZING_VIEW}),
        variant_claims={("masking", "v-groove"): frozenset({Claim.CONSERVES_ENERGY})},
    )
)
