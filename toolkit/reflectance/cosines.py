"""The cosines that every isotropic lobe is a function of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

from .blockwise import Piece, blockwise

Number = float | Floats  # a shape number: one, or an array that broadcasts against the cosines


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cosines:
    """Cosines between normal n, light l, view v, half vector h and mirrored light r; arrays of one shape, float64.

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
        vectors = [_parts(vector) for vector in (normal, light, view)]
        found = blockwise(lambda piece: _cosines(*([piece(part) for part in parts] for parts in vectors)), whole)
        n_l, n_v, l_v, n_h, l_h, sin2_h, r_v = (np.broadcast_to(part, whole) for part in found)
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


def _cosines(n: Sequence[Floats], light: Sequence[Floats], view: Sequence[Floats]) -> tuple[Floats, ...]:
    """In the order of the fields, from components x, y, z."""
    n_l, n_v, l_v = _dot(n, light), _dot(n, view), _dot(light, view)
    both = [a + b for a, b in zip(light, view, strict=True)]  # 2 cos(theta_d) h
    length2 = np.maximum(_sum_of_squares(*both), 1e-24)
    length = np.sqrt(length2)
    across = _sum_of_squares(
        n[1] * both[2] - n[2] * both[1], n[2] * both[0] - n[0] * both[2], n[0] * both[1] - n[1] * both[0]
    )
    lit, seen = np.maximum(n_l, 0.0), np.maximum(n_v, 0.0)
    return lit, seen, l_v, (n_l + n_v) / length, 0.5 * length, across / length2, 2 * n_l * n_v - l_v


def _dot(p: Sequence[Floats], q: Sequence[Floats]) -> Floats:
    """Scalar product from components."""
    return np.asarray(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


def _parts(vectors: Floats) -> tuple[Floats, Floats, Floats]:
    """Components; of one vector that is repeated everywhere, as of a far light, once only."""
    if not any(vectors.strides[:-1]):
        vectors = vectors[(slice(1),) * (vectors.ndim - 1)]
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _sum_of_squares(x: Floats, y: Floats, z: Floats) -> Floats:
    return np.asarray(x * x + y * y + z * z)
