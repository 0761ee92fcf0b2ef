r"""Hazy GGX: a sharp highlight in a halo of its own width, the sum of two GGX lobes.

For lacquers, enamels and polished metals that mirror a lamp and show a soft disc of light about it: most facets lie
in a smooth surface, the share `haze` of them in a rougher one, `spread` times as wide. A single lobe with a long tail
(`gtr`) makes the halo hang on the core; here it has a width of its own, which a photograph with a clipped core still
tells. At `haze` 0 it is `ggx`. A halo wider than alpha 1 is taken as of alpha 1.

`masking`: as of `ggx`, each of the two lobes by its own slopes.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["hazy-ggx"].value(facing, (0.1, 0.0, 5.0)).round(3)
    array([7.958])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from . import ggx
from .cosines import Cosines, Number
from .lobe import Claim, Lobe, Parameter, register
from .microfacet import MASKING


def evaluate(cosines: Cosines, alpha: Number, haze: Number, spread: Number, *, masking: str = "smith") -> Floats:
    """G D / (4 n.v) of both surfaces by their shares, F left out, in sr^-1."""
    share, wide = np.asarray(haze), np.minimum(np.multiply(alpha, spread), 1.0)
    core = ggx.evaluate(cosines, alpha, masking=masking)
    return np.asarray((1.0 - share) * core + share * ggx.evaluate(cosines, wide, masking=masking))


def gradient(
    cosines: Cosines, alpha: Number, haze: Number, spread: Number, *, masking: str = "smith"
) -> tuple[Floats, ...]:
    """The value, and its derivatives by alpha, haze and spread."""
    share, product = np.asarray(haze), np.multiply(alpha, spread)
    wide, grows = np.minimum(product, 1.0), product < 1.0
    (core, by_core), (halo, by_wide) = (ggx.gradient(cosines, width, masking=masking) for width in (alpha, wide))
    value, by_wide = (1.0 - share) * core + share * halo, share * by_wide * grows
    return value, (1.0 - share) * by_core + by_wide * np.asarray(spread), halo - core, by_wide * np.asarray(alpha)


register(
    Lobe(
        name="hazy-ggx",
        title="Hazy GGX (a core and a halo)",
        kind="specular",
        colour="specular_strength",
        parameters=(
            Parameter(
                name="alpha",
                unit="1",
                low=0.005,
                high=1.0,
                log=True,
                starts=(0.01, 0.04, 0.15, 0.5),
                typical="0.01 lacquer, 0.1 satin",
                meaning="width of the facets' slopes",
            ),
            Parameter(
                name="haze",
                unit="1",
                low=0.0,
                high=1.0,
                log=False,
                starts=(0.2, 0.6),
                typical="0 clear, 0.2 hazy",
                meaning="share of the facets that lie in the rougher surface",
            ),
            Parameter(
                name="spread",
                unit="1",
                low=1.5,
                high=40.0,
                log=True,
                starts=(3.0, 10.0),
                typical="5",
                meaning="width of the halo's slopes over the core's",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{1}{4\, n \cdot v} \left[(1 - \beta)\, G_\alpha D_\alpha "
        r"+ \beta\, G_{s\alpha} D_{s\alpha}\right], "
        r"\quad D_\alpha = \frac{\alpha^2}{\pi (\cos^2\theta_h (\alpha^2 - 1) + 1)^2}",
        source="barla2018",
        sharp_angle="half",
        fresnel=True,
        variants={"masking": MASKING},
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
