"""From D and G to a lobe: facets that are small mirrors give G D / (4 n.v), the cosine n.l included, F left out."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import TINY, Cosines

MASKING = "smith", "smith-correlated", "v-groove"


def microfacet(cosines: Cosines, seen_density: Floats) -> Floats:
    """G D / (4 n.v) from `seen_density` = G D, in sr^-1 (Torrance & Sparrow 1967; Walter et al. 2007, equation 20).

    0 where n.l or n.v is 0, since G is.
    """
    return microfacets(cosines, seen_density)[0]


def microfacets(cosines: Cosines, *seen_densities: Floats) -> tuple[Floats, ...]:
    """The same of several, as of G D and its derivatives."""
    facing = 0.25 / np.maximum(cosines.n_dot_v, TINY)
    return tuple(facing * part for part in seen_densities)
