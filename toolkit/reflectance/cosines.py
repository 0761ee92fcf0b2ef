"""The cosines that every isotropic lobe is a function of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toolkit.records import Floats

from .blockwise import Piece, blockwise

TINY = 1e-30  # keeps a quotient finite, in single precision as well

Number = float | Floats  # a shape number: one, or an array that broadcasts against the cosines


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cosines:
    """Cosines between normal n, light l, view v, half vector h and mirrored light r; arrays of one shape and precision.

    `n_dot_l` and `n_dot_v` are clipped at 0. `sin2_h` is sin^2 of the normal-half angle, accurate near 0.
    """

    n_dot_l: Floats
    n_dot_v: Floats
    l_dot_v: Floats
    n_dot_h: Floats
    l_dot_h: Floats  # = v_dot_h, the cosine of theta_d
    sin2_h: Floats
    r_dot_v: Floats  # not clipped
    source_radius_rad: float = 0.0  # the light's angular radius, for the mirror lobe

    @classmethod
    def of(cls, normal: Floats, light: Floats, view: Floats, *, source_radius_rad: float = 0.0) -> Cosines:
        """From unit vectors (..., 3) that broadcast against each other."""
        whole = np.broadcast_shapes(normal.shape, light.shape, view.shape)[:-1]
        vectors = [parts_of(vector) for vector in (normal, light, view)]
        found = blockwise(lambda piece: _cosines(*([piece(part) for part in parts] for parts in vectors)), whole)
        n_l, n_v, l_v, n_h, l_h, sin2_h, r_v = (
            part if part.shape == whole else np.broadcast_to(part, whole) for part in found
        )
        return cls(
            n_dot_l=n_l,
            n_dot_v=n_v,
            l_dot_v=l_v,
            n_dot_h=n_h,
            l_dot_h=l_h,
            sin2_h=sin2_h,
            r_dot_v=r_v,
            source_radius_rad=source_radius_rad,
        )

    def part(self, piece: Piece) -> Cosines:
        """One block of the directions."""
        return Cosines(
            n_dot_l=piece(self.n_dot_l),
            n_dot_v=piece(self.n_dot_v),
            l_dot_v=piece(self.l_dot_v),
            n_dot_h=piece(self.n_dot_h),
            l_dot_h=piece(self.l_dot_h),
            sin2_h=piece(self.sin2_h),
            r_dot_v=piece(self.r_dot_v),
            source_radius_rad=self.source_radius_rad,
        )

    def stepped(self, step: float) -> tuple[Cosines, Cosines, Cosines]:
        """With n.l less by a small `step`, with n.v less by it, with l.v more by it, the other two as they are.

        Each turns the normal away from the half vector: there are such vectors even at a highlight's centre.
        """
        turn = step / (2.0 * self.l_dot_h)
        aside = replace(self, n_dot_h=self.n_dot_h - turn, sin2_h=self.sin2_h + turn * (2.0 * self.n_dot_h - turn))
        less_lit, less_seen = np.maximum(self.n_dot_l - step, 0.0), np.maximum(self.n_dot_v - step, 0.0)
        nearer = per_place(self.l_dot_h, lambda cosine: np.sqrt(np.square(cosine) + 0.5 * step))
        short = np.square(self.l_dot_h / nearer)  # of |l + v|, squared: before over after
        return (
            replace(aside, n_dot_l=less_lit, r_dot_v=self.r_dot_v - 2.0 * step * self.n_dot_v),
            replace(aside, n_dot_v=less_seen, r_dot_v=self.r_dot_v - 2.0 * step * self.n_dot_l),
            replace(
                self,
                l_dot_v=self.l_dot_v + step,
                l_dot_h=nearer,
                n_dot_h=self.n_dot_h * np.sqrt(short),
                sin2_h=self.sin2_h + np.square(self.n_dot_h) * (1.0 - short),
                r_dot_v=self.r_dot_v - step,
            ),
        )


def per_place(values: Floats, function: Callable[[Floats], Floats]) -> Floats:
    """A function of values over places; one that is repeated without being stored stays so."""
    found = function(once(values))
    return np.asarray(found) if any(values.strides) else np.broadcast_to(found, values.shape)


def once(values: Floats) -> Floats:
    """One that is repeated without being stored as a single one, of as many axes; others as they are."""
    return values if any(values.strides) else values[(slice(1),) * values.ndim]


def constant(values: Floats) -> float | None:
    """The one value that an array repeats without storing it, as a far light's do; else None."""
    return None if any(values.strides) else float(values.flat[0])


def dots(normal: Floats, light: Floats, view: Floats) -> tuple[Floats, Floats, Floats]:
    """n.l, n.v and l.v of unit vectors (..., 3), not clipped; of vectors that are repeated everywhere once only."""
    return _products(normal, light), _products(normal, view), _products(light, view)


def _products(vectors: Floats, others: Floats) -> Floats:
    """Scalar products of vectors (..., 3); with one that is repeated everywhere as a product of matrices."""
    if any(others.strides[:-1]) or not others.size:
        return dot(parts_of(vectors), parts_of(others))
    return np.asarray(_first(vectors) @ others[(0,) * (others.ndim - 1)])


def _cosines(n: Sequence[Floats], light: Sequence[Floats], view: Sequence[Floats]) -> tuple[Floats, ...]:
    """In the order of the fields, from components x, y, z."""
    n_l, both = dot(n, light), [a + b for a, b in zip(light, view, strict=True)]  # 2 cos(theta_d) h
    along_z = view[2].size == 1 and [part.item() for part in view] == [0.0, 0.0, 1.0]  # a camera without perspective
    n_v, l_v = (n[2], light[2]) if along_z else (dot(n, view), dot(light, view))
    length2 = np.maximum(_sum_of_squares(*both), 1e-24)
    length = np.sqrt(length2)
    across = _sum_of_squares(
        n[1] * both[2] - n[2] * both[1], n[2] * both[0] - n[0] * both[2], n[0] * both[1] - n[1] * both[0]
    )
    lit, seen = np.maximum(n_l, 0.0), np.maximum(n_v, 0.0)
    return lit, seen, l_v, (n_l + n_v) / length, 0.5 * length, across / length2, 2 * n_l * n_v - l_v


def dot(p: Sequence[Any], q: Sequence[Any]) -> Floats:
    """Scalar product from components, arrays or numbers."""
    return np.asarray(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


def parts_of(vectors: Floats) -> tuple[Floats, Floats, Floats]:
    """Components; of one vector that is repeated everywhere, as of a far light, once only."""
    vectors = _first(vectors)
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _first(vectors: Floats) -> Floats:
    """Vectors (..., 3); one that is repeated everywhere once only, with as many axes."""
    return vectors if any(vectors.strides[:-1]) else vectors[(slice(1),) * (vectors.ndim - 1)]


def _sum_of_squares(x: Floats, y: Floats, z: Floats) -> Floats:
    return np.asarray(x * x + y * y + z * z)
