"""G: the share of facets seen by both the light and the camera.

`v-groove` is Torrance and Sparrow's; it needs no width, and conserves energy with any D. Smith's needs a D whose
slopes have a known one-sided G1: `smith` multiplies light's and view's G1, `smith-correlated` knows that a high
facet is seen by both (Heitz 2014, equation 99).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from .cosines import TINY, Cosines, Number


def v_groove(cosines: Cosines) -> Floats:
    """G of long symmetric grooves: min(1, 2 (n.h)(n.v)/(v.h), 2 (n.h)(n.l)/(v.h)).

    Torrance & Sparrow 1967; Blinn 1977.
    """
    facing = 2.0 * cosines.n_dot_h / np.maximum(cosines.l_dot_h, TINY)
    return np.asarray(np.minimum(facing * np.minimum(cosines.n_dot_l, cosines.n_dot_v), 1.0))


def beckmann_one_sided(cosine: Floats, alpha: Number) -> Floats:
    """Walter's rational G1 of Beckmann's D (2007, equation 27).

    Up to 6e-3 from Smith's exact G1; it steps by 6e-5 where it reaches 1.
    """
    hiding, a, _ = _where_facets_hide(cosine, alpha)
    return hiding.filled(a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a)), 1.0)


def beckmann_one_sided_gradient(cosine: Floats, alpha: Number) -> tuple[Floats, ...]:
    """Walter's rational G1, and its derivative in `alpha`."""
    hiding, a, width = _where_facets_hide(cosine, alpha)
    above, below = a * (3.535 + 2.181 * a), 1.0 + a * (2.276 + 2.577 * a)
    slope = ((3.535 + 4.362 * a) * below - above * (2.276 + 5.154 * a)) / np.square(below)
    return hiding.filled(above / below, 1.0), hiding.filled(slope * (-a / width), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Some places of an array: near grazing they are few, so that only they are worked out."""

    shape: tuple[int, ...]
    flat: NDArray[np.intp]

    def of(self, values: Number) -> Floats:
        """An array's values there; one number is as good as many."""
        every = np.asarray(values)
        if not every.ndim:
            return every
        return (every if every.shape == self.shape else np.broadcast_to(every, self.shape)).take(self.flat)

    def filled(self, values: Floats, elsewhere: float) -> Floats:
        """The whole array, of values there and one number everywhere else."""
        found = np.full(self.shape, elsewhere, values.dtype)
        found.reshape(-1)[self.flat] = values
        return found


def _where_facets_hide(cosine: Floats, alpha: Number) -> tuple[_Places, Floats, Floats]:
    """Where Walter's G1 is not 1, which is near grazing, and there its a = cot(theta) / alpha and alpha."""
    flattest = 1.6 * np.asarray(alpha)
    hiding = np.asarray(cosine < flattest / np.sqrt(1.0 + np.square(flattest)))
    places = _Places(hiding.shape, np.flatnonzero(hiding))
    width = places.of(alpha)
    return places, _cotangent(places.of(cosine)) / width, width


def _cotangent(cosine: Floats) -> Floats:
    return np.asarray(cosine / np.sqrt(np.maximum(1.0 - np.square(cosine), TINY)))


def ggx_one_sided(cosine: Floats, alpha: Number) -> Floats:
    """Smith's exact G1 of GGX (Walter et al. 2007, equation 34)."""
    return np.asarray(2.0 * cosine / ggx_denominator(cosine, alpha))


def ggx_denominator(cosine: Floats, alpha: Number) -> Floats:
    """2 cos / G1 of GGX."""
    return np.asarray(cosine + _ggx_root(cosine, alpha))


def ggx_one_sided_gradient(cosine: Floats, alpha: Number) -> tuple[Floats, ...]:
    """Smith's exact G1 of GGX, and its derivative in `alpha`."""
    root = np.maximum(_ggx_root(cosine, alpha), TINY)
    both = cosine + root
    return 2.0 * cosine / both, -2.0 * cosine * alpha * (1.0 - np.square(cosine)) / (np.square(both) * root)


def _ggx_root(cosine: Floats, alpha: Number) -> Floats:
    a2 = np.square(alpha)
    return np.asarray(np.sqrt(a2 + (1.0 - np.asarray(a2)) * np.square(cosine)))


@dataclass(frozen=True, slots=True, kw_only=True)
class OneSided:
    """Smith's G1 of one D, (cosine, *shape) -> array; `gradient` returns the same, then its derivative in each."""

    value: Callable[..., Floats]
    gradient: Callable[..., tuple[Floats, ...]]


BECKMANN = OneSided(value=beckmann_one_sided, gradient=beckmann_one_sided_gradient)
GGX = OneSided(value=ggx_one_sided, gradient=ggx_one_sided_gradient)


def masking(cosines: Cosines, choice: str, smith: OneSided, *shape: Number) -> Floats:
    """G for `choice`, one of "v-groove", "smith", "smith-correlated"; `shape` is that of the D masked."""
    if choice == "v-groove":
        return v_groove(cosines)
    light, view = smith.value(cosines.n_dot_l, *shape), smith.value(cosines.n_dot_v, *shape)
    if choice == "smith":
        return light * view
    return light * view / _either(light, view)


def masking_derivatives(
    cosines: Cosines, choice: str, smith: OneSided, *shape: Number
) -> tuple[Floats, tuple[Floats, ...]]:
    """G for `choice`, and its derivative in each shape number."""
    if choice == "v-groove":
        return v_groove(cosines), tuple(np.zeros(()) for _ in shape)
    light, *by_light = smith.gradient(cosines.n_dot_l, *shape)
    view, *by_view = smith.gradient(cosines.n_dot_v, *shape)
    if choice == "smith":
        return light * view, tuple(a * view + light * b for a, b in zip(by_light, by_view, strict=True))
    either = _either(light, view)
    ahead, behind = np.square(view / either), np.square(light / either)
    return light * view / either, tuple(ahead * a + behind * b for a, b in zip(by_light, by_view, strict=True))


def _either(light: Floats, view: Floats) -> Floats:
    """The denominator of 1 / (1/light + 1/view - 1)."""
    return np.asarray(np.maximum(light + view - light * view, TINY))
