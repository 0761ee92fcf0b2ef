"""Lambert: a body that looks equally bright from everywhere.

For plaster, paper, and the body colour under a highlight when nothing better is known; away from the highlight of
a glossy ball it leaves 3.7 % where `wolff` leaves less. It has no shape number: its albedo is its whole story.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["lambert"].value(facing, ()).round(4)
    array([0.3183])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines
from .lobe import Claim, Lobe, register


def evaluate(cosines: Cosines) -> Floats:
    """(n.l) / pi, in sr^-1."""
    return np.asarray(cosines.n_dot_l * (cosines.n_dot_v > 0.0) / np.pi)


def gradient(cosines: Cosines) -> tuple[Floats, ...]:
    """The value: there is nothing to derive by."""
    return (evaluate(cosines),)


register(
    Lobe(
        name="lambert",
        title="Lambert",
        kind="diffuse",
        colour="diffuse_albedo",
        parameters=(),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{n \cdot l}{\pi}",
        source="lambert1760",
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
