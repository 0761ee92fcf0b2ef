r"""Mirror: the light's own disc, seen in the surface through the camera's blur.

For chrome, glass, still water, the clear coat over paint: a surface so smooth that its highlight is a picture of the
lamp. The slides' double delta, made finite: a disc of the lamp's angular radius R round the mirrored direction,
1 / (pi sin^2 R) high, so that it shows the lamp's own radiance, convolved with a Gaussian of sd `blur_rad` (camera
blur, pixel size and a little waviness, as an angle of the mirrored ray). A lamp without a size is the Gaussian alone.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)), source_radius_rad=0.1)
    >>> LOBES["mirror"].value(facing, (0.001,)).round(3)
    array([31.937])
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .lobe import Claim, Lobe, Parameter, register

_REACH = 9.0  # standard deviations beyond which the blur is nothing
_NODES = 96


def evaluate(cosines: Cosines, blur_rad: Number) -> Floats:
    """Disc times Gaussian over 1 / (pi sin^2 R), in sr^-1; 0 behind either horizon."""
    blur, angle, lit = np.broadcast_arrays(np.asarray(blur_rad, float), _angle(cosines), _lit(cosines))
    radius = cosines.source_radius_rad
    value = np.zeros(angle.shape)
    near = lit & (angle < radius + _REACH * blur)
    if radius == 0.0:
        value[near] = np.exp(-0.5 * np.square(angle[near] / blur[near])) / (2.0 * np.pi * np.square(blur[near]))
    else:
        value[near] = _covered(angle[near], blur[near], radius) / (np.pi * np.sin(radius) ** 2)
    return value


def gradient(cosines: Cosines, blur_rad: Number) -> tuple[Floats, ...]:
    """The value, and its derivative by blur_rad."""
    blur, angle, lit = np.broadcast_arrays(np.asarray(blur_rad, float), _angle(cosines), _lit(cosines))
    radius = cosines.source_radius_rad
    slope = np.zeros(angle.shape)
    near = lit & (angle < radius + _REACH * blur)
    if radius == 0.0:
        squared = np.square(angle[near] / blur[near])
        slope[near] = np.exp(-0.5 * squared) * (squared - 2.0) / (2.0 * np.pi * np.power(blur[near], 3))
    else:
        slope[near] = _covered_slope(angle[near], blur[near], radius) / (np.pi * np.sin(radius) ** 2)
    return evaluate(cosines, blur_rad), slope


def _angle(cosines: Cosines) -> Floats:
    """The angle between the mirrored light and the view, from its chord."""
    return np.asarray(2.0 * np.arcsin(np.sqrt(np.clip(0.5 * (1.0 - cosines.r_dot_v), 0.0, 1.0))))


def _lit(cosines: Cosines) -> Floats:
    return np.asarray((cosines.n_dot_l > 0.0) & (cosines.n_dot_v > 0.0))


def _covered(angle: Floats, blur: Floats, radius: float) -> Floats:
    """The share of a Gaussian at `angle` from a disc's centre that falls on the disc: 1 - Marcum's Q1.

    int_0^R r/s^2 exp(-(r^2 + angle^2) / (2 s^2)) I0(r angle / s^2) dr by Gauss-Legendre where the integrand lives.
    """
    from scipy.special import i0e

    low, high = np.clip(angle - _REACH * blur, 0.0, radius), np.minimum(angle + _REACH * blur, radius)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    total = np.zeros(angle.shape)
    for node, weight in zip(nodes, weights, strict=True):
        r = 0.5 * (low + high) + 0.5 * (high - low) * node
        total += weight * r * np.exp(-0.5 * np.square((r - angle) / blur)) * i0e(r * angle / np.square(blur))
    return np.asarray(total * 0.5 * (high - low) / np.square(blur))


def _covered_slope(angle: Floats, blur: Floats, radius: float) -> Floats:
    """The derivative of `_covered` in `blur`, in closed form from Marcum's Q1 (a = angle / s, b = radius / s)."""
    from scipy.special import i0e, i1e

    a, b = angle / blur, radius / blur
    return np.asarray(b / blur * np.exp(-0.5 * np.square(a - b)) * (a * i1e(a * b) - b * i0e(a * b)))


register(
    Lobe(
        name="mirror",
        title="Mirror",
        kind="specular",
        colour="specular_strength",
        parameters=(
            Parameter(
                name="blur_rad",
                unit="rad",
                low=0.0005,
                high=0.2,
                log=True,
                starts=(0.003, 0.02, 0.08),
                typical="0.003 a sharp photograph of a ball 400 pixels wide",
                meaning="standard deviation of the blur, as an angle of the mirrored ray",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{\mathrm{disc}_R \ast \mathcal{N}_s}{\pi \sin^2 R}(\angle(r, v)), \quad r = 2 (n \cdot l) n - l",
        source="nayar1991",
        sharp_angle="mirror",
        sees_source=True,
        fresnel=True,
        claims=frozenset({Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
