"""Lights moved, and extended lights as several small ones, so that every lobe need only know small lights."""

from __future__ import annotations

import numpy as np

from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.records import Floats, Light

Movable = DirectionalLight | PointLight


def point_lights(light: Light, *, detail_rad: float) -> list[Light]:
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
    small = movable(light).model_copy(update={"angular_radius_deg": 0.0})
    return [scaled(moved(small, to), part) for to, part in zip(places, share, strict=True)]


def disc_points(*, rings: int) -> tuple[Floats, Floats]:
    """Points (N, 2) in the unit disc and weights (N,) that sum to 1: Gauss-Legendre in r^2, equal steps around."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    radii, around = np.sqrt(0.5 * (nodes + 1.0)), 4 * rings + 2
    angle = 2.0 * np.pi * (np.arange(around) + 0.5 * np.arange(rings)[:, None]) / around
    points = radii[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return points.reshape(-1, 2), np.repeat(0.5 * weights / around, around)


def movable(light: Light) -> Movable:
    """The light itself where it has one direction or place; raises TypeError on other kinds."""
    if not isinstance(light, Movable):
        raise TypeError(f"a {light.kind} light cannot be moved; expected a directional or a point light")
    return light


def vector(light: Light) -> Floats:
    """Where the light is: its direction (3,), or its place in sphere radii."""
    return np.asarray(light.position if isinstance(light, PointLight) else light.direction)


def moved(light: Light, to: Floats) -> Movable:
    """The same light at another place (3,), or in another direction; its irradiance stays that at the centre."""
    if isinstance(light, PointLight):
        return light.model_copy(update={"position": triple(to)})
    return movable(light).model_copy(update={"direction": triple(to / np.linalg.norm(to))})


def scaled(light: Light, factor: float) -> Movable:
    """The same light, `factor` times as strong; where its irradiance is not known it counts as 1."""
    irradiance = factor * np.asarray(light.irradiance or (1.0, 1.0, 1.0))
    return movable(light).model_copy(update={"irradiance": triple(irradiance)})


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
