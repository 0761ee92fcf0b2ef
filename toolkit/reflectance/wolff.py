r"""Wolff: the body under a smooth clear surface, darker towards the limb than Lambert's.

For glossy paint, plastic, glazed ceramics, billiard balls: light enters through the surface, scatters inside, and
leaves through the surface again, each time less the flatter its angle. The way out loses as much as the way in at
the same angle outside, by reversibility, so one Fresnel factor serves both. `diffuse_albedo` is the share that
comes out again of the light that went in, internal reflections included; index 1 would be Lambert.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["wolff"].value(facing, (1.5,)).round(4)
    array([0.2934])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .fresnel import dielectric, dielectric_derivative
from .lobe import Claim, Lobe, Parameter, register


def evaluate(cosines: Cosines, diffuse_index: Number) -> Floats:
    """(n.l) / pi (1 - F(n.l)) (1 - F(n.v)), in sr^-1."""
    enters = 1.0 - dielectric(cosines.n_dot_l, diffuse_index)
    leaves = 1.0 - dielectric(cosines.n_dot_v, diffuse_index)
    return np.asarray(cosines.n_dot_l * (cosines.n_dot_v > 0.0) * enters * leaves / np.pi)


def gradient(cosines: Cosines, diffuse_index: Number) -> tuple[Floats, ...]:
    """The value, and its derivative by diffuse_index."""
    f_light, d_light = dielectric_derivative(cosines.n_dot_l, diffuse_index)
    f_view, d_view = dielectric_derivative(cosines.n_dot_v, diffuse_index)
    change = (f_light - 1.0) * d_view + (f_view - 1.0) * d_light
    lit = cosines.n_dot_l * (cosines.n_dot_v > 0.0) / np.pi
    return lit * (1.0 - f_light) * (1.0 - f_view), lit * change


register(
    Lobe(
        name="wolff",
        title="Wolff (smooth dielectric)",
        kind="diffuse",
        colour="diffuse_albedo",
        parameters=(
            Parameter(
                name="diffuse_index",
                unit="1",
                low=1.3,
                high=1.8,
                log=False,
                starts=(1.35, 1.5, 1.7),
                typical="1.33 water, 1.5 plastic and paint, 1.7 dense glaze",
                meaning="refractive index of the clear surface over the body",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{n \cdot l}{\pi} \bigl(1 - F(n \cdot l)\bigr) \bigl(1 - F(n \cdot v)\bigr)",
        source="wolff1994",
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
