"""How much of two colours a pixel holds: x = a body + s light, by least squares weighted with its noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from toolkit.records import Floats, readonly

from .samples import Mask

PARALLEL = 1e-12  # less than 1, from which the cosine of two colours' angle is rounding


class Found(NamedTuple):
    """Of n pixels; NaN where fewer than two channels are usable."""

    both: Floats  # (2, n): a, s
    covariance: Floats  # (3, n): var, cov, var of the two
    off: Floats  # (n,) signed distance from the plane of the two colours, NaN below three channels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solver:
    """Two unit colours, `apart`, and what follows from them, in the kind of the pixels."""

    body: Floats  # (3,), float64
    light: Floats
    within: Floats  # (3, 3): a and s of the pixel's foot in their plane, and its distance from there
    leaning: Floats  # (3, 3): of the channels' variances, by how much a foot must move, times the last
    products: Floats  # (3, 3): of products of two channels' variances, the covariance

    def __post_init__(self) -> None:
        readonly(self)

    @classmethod
    def of(cls, body: Floats, light: Floats, kind: DTypeLike) -> Solver:
        """For pixels of this kind of float."""
        dual, normal = np.linalg.pinv(np.stack([body, light], axis=1)), across(body, light)
        within = np.vstack([dual, normal])
        products = np.stack([light * light, -body * light, body * body]) / (1.0 - float(body @ light) ** 2)
        return cls(
            body=body,
            light=light,
            within=within.astype(kind),
            leaning=(within * normal).astype(kind),
            products=products.astype(kind),
        )

    def solve(self, values: Floats, usable: Mask, variance: Floats) -> Found:
        """From values, (3, n), which of them are usable, and their variances, (3, n) or (3, 1)."""
        whole, some = usable[0] & usable[1] & usable[2], usable[0] | usable[1] | usable[2]
        found = self._by_all(values, variance, np.where(whole, values.dtype.type(0), values.dtype.type(np.nan)))
        rest = np.flatnonzero(some & ~whole)
        if len(rest):
            noise = np.broadcast_to(variance, values.shape)[:, rest]
            for every, few in zip(found, self._by_some(values[:, rest], usable[:, rest], noise), strict=True):
                every[..., rest] = few
        return found

    def _by_all(self, values: Floats, variance: Floats, nothing: Floats) -> Found:
        """Pixels of three channels; NaN where `nothing` (n,) is.

        With V their variances and n the plane's normal, all that a fit can leave is V n (n.x) / (n.V n): the pixel's
        foot in the plane is moved by as much as of that lies within it. The covariance is that of pairs of channels,
        each by the variance of the third; no term of it is negative, so float32 holds it.
        """
        both, lean = self.within @ values, self.leaning @ variance
        off, inverse = both[2] + nothing, 1 / lean[2]
        both = both[:2] - (lean[:2] * inverse) * off
        share = variance * inverse
        pairs = np.stack([share[1] * variance[2], share[2] * variance[0], share[0] * variance[1]])
        return Found(both, self.products @ pairs + nothing, off)

    def _by_some(self, values: Floats, usable: Mask, variance: Floats) -> Found:
        """Two normal equations a pixel, solved in closed form."""
        body, light = self.body, self.light
        weight = np.divide(usable, variance, dtype=float)
        bb, bl, ll = np.stack([body * body, body * light, light * light]) @ weight
        b, l = np.stack([body, light]) @ (weight * values)  # noqa: E741  # beside bb, bl, ll the clearest name
        seen = np.count_nonzero(usable, axis=0)
        independent = bb * ll - bl * bl
        sound = (seen >= 2) & (independent > 1e-14 * bb * ll)  # below it rounding decides
        inverse = np.where(sound, 1.0, np.nan) / np.where(sound, independent, 1.0)
        bb, bl, ll = bb * inverse, bl * inverse, ll * inverse
        off = np.where(seen < 3, np.nan, across(body, light) @ values)
        return Found(np.stack([ll * b - bl * l, bb * l - bl * b]), np.stack([ll, -bl, bb]), off)


def apart(body: Floats, light: Floats) -> bool:
    """Whether they are two colours, and not one and the same."""
    return float(body @ light) < 1 - PARALLEL


def across(body: Floats, light: Floats) -> Floats:
    """Unit normal (3,) of the plane of the two colours."""
    normal = np.cross(body, light)
    return np.asarray(normal / max(float(np.linalg.norm(normal)), 1e-300))
