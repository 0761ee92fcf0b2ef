r"""GGX: facets that are small mirrors, their slopes with a long tail; Trowbridge and Reitz's lobe.

For most of what is made: measured metals, plastics and lacquers show its broad skirt round a sharp core. Where even
this skirt is too short or too long, `gtr` frees it.

`masking`: `smith` is Smith's exact G for this D, light's and view's multiplied; `smith-correlated` knows that a
high facet is seen by both; `v-groove` is Torrance and Sparrow's.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["ggx"].value(facing, (0.1,)).round(3)
    array([7.958])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .distributions import ggx, ggx_derivative
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import MASKING, microfacet, microfacets


def evaluate(cosines: Cosines, alpha: Number, *, masking: str = "smith") -> Floats:
    """G D / (4 n.v), F left out, in sr^-1."""
    density = ggx(cosines, alpha)
    if masking == "smith":  # the same with the cosines cancelled, in two thirds of the time
        hidden = g.ggx_denominator(cosines.n_dot_l, alpha) * g.ggx_denominator(cosines.n_dot_v, alpha)
        return np.asarray(density * cosines.n_dot_l * (cosines.n_dot_v > 0.0) / hidden)
    return microfacet(cosines, density * g.masking(cosines, masking, g.GGX, alpha))


def gradient(cosines: Cosines, alpha: Number, *, masking: str = "smith") -> tuple[Floats, ...]:
    """The value, and its derivative by alpha."""
    density, d_density = ggx_derivative(cosines, alpha)
    seen, (d_seen,) = g.masking_derivatives(cosines, masking, g.GGX, alpha)
    return microfacets(cosines, density * seen, d_density * seen + density * d_seen)


register(
    Lobe(
        name="ggx",
        title="GGX (Trowbridge-Reitz)",
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
                meaning="width of the facets' slopes: half of the surface's facets are steeper than this slope",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{G\, D(\theta_h)}{4\, n \cdot v}, \quad "
        r"D = \frac{\alpha^2}{\pi (\cos^2\theta_h (\alpha^2 - 1) + 1)^2}",
        source="walter2007",
        sharp_angle="half",
        fresnel=True,
        variants={"masking": MASKING},
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
