r"""Oren-Nayar: a rough matte body, its facets Lambertian; flatter than Lambert's, brighter back towards the light.

For plaster, clay, sand, brick, unglazed pottery, the full moon. `diffuse_roughness_rad` 0 is Lambert.

`form=qualitative` is the short form everyone uses; `form=full` is the paper's complete fit to its integral. The full
form dips below 0 at opposite grazing directions beyond about 0.65 rad, and is cut at 0 there.

`interreflection` adds the light that bounces twice between facets. It grows with the square of the albedo, so it is
not linear in the colour; it is kept linear by taking its one extra factor of albedo at a fixed 0.2, 0.5 or 0.8.
Choose the nearest to the fitted `diffuse_albedo`: what is left is under 4 % of the lobe, and most of that is a change
of scale. Constants fitted by the paper let albedo reach 1.015, so the lobe claims no conservation of energy.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["oren-nayar"].value(facing, (0.3,)).round(4)
    array([0.2842])
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

from .cosines import TINY, Cosines, Number
from .lobe import Claim, Lobe, Parameter, register

_NONE = "none"


def evaluate(
    cosines: Cosines, diffuse_roughness_rad: Number, *, form: str = "qualitative", interreflection: str = _NONE
) -> Floats:
    """(n.l) / pi times Oren and Nayar's brackets, in sr^-1."""
    return _lit(cosines) * np.maximum(_bracket(cosines, diffuse_roughness_rad, form, interreflection), 0.0)


def gradient(
    cosines: Cosines, diffuse_roughness_rad: Number, *, form: str = "qualitative", interreflection: str = _NONE
) -> tuple[Floats, ...]:
    """The value, and its derivative by diffuse_roughness_rad: only the constants of the brackets depend on it."""
    bracket, lit = _bracket(cosines, diffuse_roughness_rad, form, interreflection), _lit(cosines)
    s = np.asarray(diffuse_roughness_rad)
    slopes = [2.0 * s * b / np.square(s * s + b) for b in (0.33, 0.09, 0.13)]
    by = lit * (bracket > 0.0) * _combine(cosines, slopes, form, interreflection)
    return lit * np.maximum(bracket, 0.0), by


def _lit(cosines: Cosines) -> Floats:
    return np.asarray(cosines.n_dot_l * (cosines.n_dot_v > 0.0) / np.pi)


def _bracket(cosines: Cosines, sigma: Number, form: str, interreflection: str) -> Floats:
    s2 = np.square(sigma)
    return 1.0 + _combine(cosines, [s2 / (s2 + b) for b in (0.33, 0.09, 0.13)], form, interreflection)


def _combine(cosines: Cosines, constants: list[Floats], form: str, interreflection: str) -> Floats:
    """The brackets less 1, linear in s2 / (s2 + 0.33), s2 / (s2 + 0.09), s2 / (s2 + 0.13)."""
    c33, c09, c13 = constants
    if form == "qualitative" and interreflection == _NONE:
        return -0.5 * c33 + 0.45 * c09 * np.maximum(_projected(cosines), 0.0)
    angles = _Angles.of(cosines)
    once = angles.full() if form == "full" else 0.45 * np.maximum(_projected(cosines), 0.0)
    bounced = 0.0 if interreflection == _NONE else 0.17 * float(interreflection) * angles.twice()
    return np.asarray(-0.5 * c33 + c09 * once + c13 * bounced)


def _projected(cosines: Cosines) -> Floats:
    """cos(dphi) sin(a) tan(b), with a the larger of the two angles."""
    steep = np.maximum(np.maximum(cosines.n_dot_l, cosines.n_dot_v), TINY)
    return np.asarray(_across(cosines) / steep)


def _across(cosines: Cosines) -> Floats:
    """cos(dphi) sin(theta_l) sin(theta_v)."""
    return np.asarray((cosines.l_dot_v - cosines.n_dot_l * cosines.n_dot_v) * (cosines.n_dot_l * cosines.n_dot_v > 0.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Angles:
    larger: Floats  # the paper's alpha
    smaller: Floats  # the paper's beta
    cos_phi: Floats
    tan_smaller: Floats
    tan_mean: Floats

    @classmethod
    def of(cls, cosines: Cosines) -> _Angles:
        light, view = (np.minimum(c, 1.0) for c in (cosines.n_dot_l, cosines.n_dot_v))
        sin_l, sin_v = (np.sqrt(1.0 - np.square(c)) for c in (light, view))
        high, low = np.maximum(light, view), np.minimum(light, view)
        return cls(
            larger=np.arccos(low),
            smaller=np.arccos(high),
            cos_phi=np.clip(_across(cosines) / np.maximum(sin_l * sin_v, TINY), -1.0, 1.0),
            tan_smaller=np.minimum(sin_l, sin_v) / np.maximum(high, TINY),
            tan_mean=(sin_l + sin_v) / np.maximum(light + view, TINY),
        )

    def full(self) -> Floats:
        """The paper's C2 and C3 terms over s2 / (s2 + 0.09)."""
        shade = np.where(self.cos_phi < 0.0, np.power(2.0 * self.smaller / np.pi, 3), 0.0)
        c2 = 0.45 * (np.sin(self.larger) - shade)
        c3 = 0.125 * np.square(4.0 * self.larger * self.smaller / np.pi**2)
        return np.asarray(self.cos_phi * c2 * self.tan_smaller + (1.0 - np.abs(self.cos_phi)) * c3 * self.tan_mean)

    def twice(self) -> Floats:
        """The angles of the second bounce."""
        return np.asarray(1.0 - self.cos_phi * np.square(2.0 * self.smaller / np.pi))


register(
    Lobe(
        name="oren-nayar",
        title="Oren-Nayar",
        kind="diffuse",
        colour="diffuse_albedo",
        parameters=(
            Parameter(
                name="diffuse_roughness_rad",
                unit="rad",
                low=0.0,
                high=0.8,
                log=False,
                starts=(0.1, 0.3, 0.6),
                typical="0.1 plaster, 0.35 clay, 0.6 sand",
                meaning="standard deviation of the matte facets' slopes",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{n \cdot l}{\pi} \left[1 - \frac{\sigma^2}{2 (\sigma^2 + 0.33)} "
        r"+ \frac{0.45\, \sigma^2}{\sigma^2 + 0.09} \max(0, \cos\Delta\phi) \sin a \tan b\right]",
        source="orennayar1994",
        variants={"form": ("qualitative", "full"), "interreflection": (_NONE, "0.2", "0.5", "0.8")},
        claims=frozenset({Claim.RECIPROCAL, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
