r"""Lafortune: Phong's lobe turned into a BRDF whose axis may bend away from the mirror direction.

For measured materials with an off-specular peak, where a sum of cosine lobes is wanted: one isotropic lobe
[C_x l_x v_x + C_y l_y v_y + C_z l_z v_z]^n of the paper, with C_x = C_y = -1 and C_z = `axis_ratio`. At 1 it is
the reciprocal Phong lobe; below 1 the peak leans to grazing, above 1 to the normal. The overall size of the C's is
part of the colour; the lobe is scaled so that its largest possible value is (n + 2) / (2 pi), which conserves energy.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["lafortune"].value(facing, (50.0, 1.0)).round(3)
    array([8.276])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .lobe import Claim, Lobe, Parameter, register


def evaluate(cosines: Cosines, shininess: Number, axis_ratio: Number) -> Floats:
    """(n + 2) / (2 pi) [C . (l v)]^n n.l, in sr^-1."""
    scale = (np.asarray(shininess) + 2.0) / (2.0 * np.pi)
    base = _base(cosines, axis_ratio)
    return np.asarray(scale * np.exp(_log(base) * shininess) * (base > 0.0) * cosines.n_dot_l * _lit(cosines))


def gradient(cosines: Cosines, shininess: Number, axis_ratio: Number) -> tuple[Floats, ...]:
    """The value, and its derivatives by shininess and axis_ratio."""
    value, base = evaluate(cosines, shininess, axis_ratio), _base(cosines, axis_ratio)
    product = cosines.n_dot_l * cosines.n_dot_v
    ratio = np.asarray(axis_ratio)
    bend = np.where(ratio > 1.0, -_opposite(cosines) / np.square(ratio), product)
    by_shininess = value * (_log(base) + 1.0 / (np.asarray(shininess) + 2.0))
    return value, by_shininess, value * shininess * bend / np.maximum(base, 1e-30)


def _base(cosines: Cosines, axis_ratio: Number) -> Floats:
    """The bracket over the largest value it can take, max(1, axis_ratio)."""
    ratio = np.asarray(axis_ratio)
    return np.asarray((_opposite(cosines) + ratio * cosines.n_dot_l * cosines.n_dot_v) / np.maximum(ratio, 1.0))


def _opposite(cosines: Cosines) -> Floats:
    """-(l_x v_x + l_y v_y)."""
    return np.asarray(cosines.n_dot_l * cosines.n_dot_v - cosines.l_dot_v)


def _log(base: Floats) -> Floats:
    return np.asarray(np.log(np.clip(base, 1e-300, 1.0)))


def _lit(cosines: Cosines) -> Floats:
    return np.asarray(cosines.n_dot_v > 0.0, float)


register(
    Lobe(
        name="lafortune",
        title="Lafortune (one isotropic lobe)",
        kind="specular",
        colour="specular_albedo",
        parameters=(
            Parameter(
                name="shininess",
                unit="1",
                low=1.0,
                high=1e5,
                log=True,
                starts=(6.0, 40.0, 250.0, 2000.0),
                typical="5 satin, 50 plastic, 1000 polished",
                meaning="exponent: the highlight falls to 1/e at about sqrt(2 / n) rad from its axis",
            ),
            Parameter(
                name="axis_ratio",
                unit="1",
                low=0.5,
                high=1.5,
                log=False,
                starts=(0.95, 1.0),
                typical="0.95 paint with an off-specular peak, 1 mirror direction",
                meaning="C_z over -C_x: below 1 the highlight leans to grazing, above 1 to the normal",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{n + 2}{2 \pi} \left(\frac{-(l_x v_x + l_y v_y) + C\, l_z v_z}{\max(1, C)}\right)^n n \cdot l",
        source="lafortune1997",
        sharp_angle="mirror",
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
