"""Lights moved, and extended lights as several small ones, so that every lobe need only know small lights."""

from __future__ import annotations

import numpy as np

from toolkit.geometry.lights import AnyLight, PointLight
from toolkit.records import Floats


def point_lights(light: AnyLight, *, detail_rad: float) -> list[AnyLight]:
    """A light's disc of `angular_radius_deg`, equally bright all over, as lights without extent.

    `detail_rad` is the half width of the finest highlight that the disc is mirrored in: the wider the disc against
    it, the more lights. Together they give on a facing plane the irradiance that the disc is given.
    """
    radius = np.radians(light.angular_radius_deg)
    if radius == 0.0:
        return [light]
    offsets, weights = disc_points(rings=1 + int(np.ceil(2.0 * radius / detail_rad)))
    towards = vector(light)
    distance = float(np.linalg.norm(towards))
    places = towards + distance * np.tan(radius) * offsets @ across(towards)
    cosines = distance / np.linalg.norm(places, axis=-1)
    share = weights / (weights @ cosines)
    base = np.asarray(light.irradiance or (1.0, 1.0, 1.0))
    return [
        moved(light, to).model_copy(update={"irradiance": triple(base * part), "angular_radius_deg": 0.0})
        for to, part in zip(places, share, strict=True)
    ]


def disc_points(*, rings: int) -> tuple[Floats, Floats]:
    """Points (N, 2) in the unit disc and weights (N,) that sum to 1: Gauss-Legendre in r^2, equal steps around."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    radii, around = np.sqrt(0.5 * (nodes + 1.0)), 4 * rings + 2
    angle = 2.0 * np.pi * (np.arange(around) + 0.5 * np.arange(rings)[:, None]) / around
    points = radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return points.reshape(-1, 2), np.repeat(0.5 * weights / around, around)


def vector(light: AnyLight) -> Floats:
    """Where the light is: its direction (3,), or its place in sphere radii."""
    return np.asarray(light.position if isinstance(light, PointLight) else light.direction)


def moved(light: AnyLight, to: Floats) -> AnyLight:
    """The same light at another place (3,), or in another direction; its irradiance stays that at the centre."""
    if isinstance(light, PointLight):
        return light.model_copy(update={"position": triple(to)})
    return light.model_copy(update={"direction": triple(to / np.linalg.norm(to))})


def across(towards: Floats) -> Floats:
    """Two unit vectors (2, 3) across `towards` and each other."""
    along = towards / np.linalg.norm(towards)
    first = np.cross(along, (1.0, 0.0, 0.0) if abs(along[0]) < 0.6 else (0.0, 1.0, 0.0))
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(along, first)])


def triple(values: Floats) -> tuple[float, float, float]:
    """Three numbers as a scene file holds them."""
    a, b, c = (float(v) for v in values)
    return a, b, c
