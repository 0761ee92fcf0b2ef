"""A white furnace by quadrature: the radiance that a surface shows under light of radiance 1 from everywhere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance import Lobe

from .space import direction, seen


def albedo(lobe: Lobe, shape: tuple[float, ...], variant: Mapping[str, str], view_rad: float) -> float:
    """The lobe integrated over all lights for one view, on nodes that follow the angle in which it is sharp."""
    view = direction(view_rad, 0.0)
    light, weight = {"half": _by_half, "mirror": _by_mirror, None: _by_light}[lobe.sharp_angle](view)
    return float(np.sum(lobe.value(seen(light, view), shape, variant) * weight))


def _by_light(view: Floats) -> tuple[Floats, Floats]:
    return _cap(np.pi / 2, first=1e-3)


def _by_half(view: Floats) -> tuple[Floats, Floats]:
    half, weight = _cap(np.pi / 2, first=1e-4)
    v_dot_h = half @ view
    light = 2.0 * v_dot_h[:, None] * half - view
    return light, weight * 4.0 * np.maximum(v_dot_h, 0.0)


def _by_mirror(view: Floats) -> tuple[Floats, Floats]:
    around, weight = _cap(np.pi, first=1e-4)
    axis = view * [-1.0, -1.0, 1.0]
    side = np.array([0.0, 1.0, 0.0])
    light = around @ np.stack([np.cross(side, axis), side, axis])
    return light, weight


def _cap(reach_rad: float, *, first: float) -> tuple[Floats, Floats]:
    """Directions and solid angles: Gauss-Legendre on intervals that grow from the axis, midpoints in azimuth."""
    edges = np.concatenate([[0.0], np.geomspace(first, reach_rad, 18)])
    node, share = np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(edges)[:, None]
    polar = (edges[:-1, None] + half * (1.0 + node)).ravel()
    weight = (half * share).ravel() * np.sin(polar)
    azimuth = (np.arange(128) + 0.5) * (2 * np.pi / 128)
    return direction(polar[:, None], azimuth).reshape(-1, 3), np.repeat(weight * (2 * np.pi / 128), 128)
