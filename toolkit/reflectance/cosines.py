"""The cosines that every isotropic lobe is a function of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

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
        n_l, n_v, l_v = _dot(normal, light), _dot(normal, view), _dot(light, view)
        n, both = _parts(normal), [a + b for a, b in zip(_parts(light), _parts(view), strict=True)]  # 2 cos(theta_d) h
        length2 = np.maximum(_sum_of_squares(*both), 1e-24)
        length = np.sqrt(length2)
        across = _sum_of_squares(
            n[1] * both[2] - n[2] * both[1], n[2] * both[0] - n[0] * both[2], n[0] * both[1] - n[1] * both[0]
        )
        shape = np.broadcast_shapes(normal.shape, light.shape, view.shape)[:-1]
        return cls(
            n_dot_l=np.maximum(np.broadcast_to(n_l, shape), 0.0),
            n_dot_v=np.maximum(np.broadcast_to(n_v, shape), 0.0),
            l_dot_v=np.broadcast_to(l_v, shape),
            n_dot_h=np.broadcast_to((n_l + n_v) / length, shape),
            l_dot_h=np.broadcast_to(0.5 * length, shape),
            sin2_h=np.broadcast_to(across / length2, shape),
            r_dot_v=np.broadcast_to(2 * n_l * n_v - l_v, shape),
            source_radius_rad=source_radius_rad,
        )


def _dot(a: Floats, b: Floats) -> Floats:
    """Scalar products along the last axis."""
    p, q = _parts(a), _parts(b)
    return np.asarray(p[0] * q[0] + p[1] * q[1] + p[2] * q[2])


def _parts(vectors: Floats) -> tuple[Floats, Floats, Floats]:
    """Components; of one vector that is repeated everywhere, as of a far light, once only."""
    if not any(vectors.strides[:-1]):
        vectors = vectors[(slice(1),) * (vectors.ndim - 1)]
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def _sum_of_squares(x: Floats, y: Floats, z: Floats) -> Floats:
    return np.asarray(x * x + y * y + z * z)
