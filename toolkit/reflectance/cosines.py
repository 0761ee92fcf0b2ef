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
        half = light + view
        half = half / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-12)

        def dot(a: Floats, b: Floats) -> Floats:
            return np.asarray(np.einsum("...i,...i->...", a, b))

        nl, nv, lv = dot(normal, light), dot(normal, view), dot(light, view)
        cross = np.cross(normal, half)
        shape = np.broadcast_shapes(nl.shape, nv.shape, lv.shape)
        return cls(
            n_dot_l=np.maximum(np.broadcast_to(nl, shape), 0.0),
            n_dot_v=np.maximum(np.broadcast_to(nv, shape), 0.0),
            l_dot_v=np.broadcast_to(lv, shape),
            n_dot_h=np.broadcast_to(dot(normal, half), shape),
            l_dot_h=np.broadcast_to(dot(light, half), shape),
            sin2_h=np.broadcast_to(dot(cross, cross), shape),
            r_dot_v=np.broadcast_to(2 * nl * nv - lv, shape),
            source_radius_rad=source_radius_rad,
        )
