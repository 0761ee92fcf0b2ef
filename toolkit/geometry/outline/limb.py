"""What a stretch of limb looks like: a shaded sphere, blurred, before a background that it hides.

Just inside the outline of a sphere of radius R, at depth uR, the normal leans to the camera by n.v = sqrt(2u - u^2) and
the light's cosine is l_r (1 - u) + l_z sqrt(2u - u^2), clamped at the terminator; a clear coat takes away what Fresnel
reflects, the less so at grazing the rougher it is: no roughness is Wolff's smooth dielectric, much of it is Lambert.
One direction of light and one coat serve the whole limb. A step alone would be drawn inwards by the darkening towards
the limb, and would take a terminator for one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

AZIMUTHS = 96  # of the table of the body's reflection
TABLE_STEP = 0.1  # samples between its depths
NODES = 100  # of the blur's integral, closer towards the limb
PRIOR = np.array([3.0, 0.5, 3.0, 0.5, 0.25, 0.15])  # sds of the columns' coefficients, in the ball's level
BODY = 2  # the body's column
COLUMNS = len(PRIOR)
INDEX = 1.5  # of the coat


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """Blurred body reflection in a table of depths (samples, from `low`) by azimuths."""

    low: float
    reflected: Floats

    def __post_init__(self) -> None:
        readonly(self)

    def at(self, depth: Floats, azimuth: Floats) -> Floats:
        """Reflection at depths and azimuths of one shape."""
        from scipy.ndimage import map_coordinates

        place = np.stack([(depth - self.low) / TABLE_STEP, azimuth % (2 * np.pi) * (AZIMUTHS / (2 * np.pi))])
        return np.asarray(map_coordinates(self.reflected, place, order=1, mode="nearest"))


def body(low: float, high: float, *, blur: float, radius: float, light: Floats, coat: float, cone_rad: float) -> Body:
    """The body's table from depth `low` to `high`; lengths in samples, `blur` the sd with the sample's own area.

    `light` (3,) has x and y as in the picture (y down) and z to the camera; `cone_rad` is the angular radius.
    """
    depths = np.arange(low, high + TABLE_STEP, TABLE_STEP)
    end = np.sqrt(max(high, 0.0) + 5 * blur)
    root = (np.arange(NODES) + 0.5) * (end / NODES)
    kernel = np.exp(-0.5 * ((depths[:, None] - root**2) / blur) ** 2) * (2 * root * end / NODES)
    kernel /= blur * np.sqrt(2 * np.pi)
    return Body(low=low, reflected=kernel @ shade(root**2 / radius, light, coat, cone_rad))


def shade(u: Floats, light: Floats, coat: float, cone_rad: float) -> Floats:
    """Body reflection (depths, AZIMUTHS + 1) at depths u, in radii, under a coat of that roughness (Wolff 1994)."""
    azimuth = np.arange(AZIMUTHS + 1) * (2 * np.pi / AZIMUTHS)
    nv = np.sqrt(np.maximum(2 * u - u * u, 0.0))[:, None]
    across = np.cos(azimuth) * light[0] + np.sin(azimuth) * light[1]
    radial = np.cos(cone_rad) * across + np.sin(cone_rad) * light[2]
    towards = np.cos(cone_rad) * light[2] - np.sin(cone_rad) * across
    nl = np.clip(radial * (1 - u)[:, None] + towards * nv, 0.0, 1.0)
    through = [1 - fresnel(np.minimum(np.hypot(cos, coat), 1.0)) for cos in (nl, nv)]
    return np.asarray(nl * through[0] * through[1] / (1 - fresnel(np.ones(1))) ** 2)


def fresnel(cos: Floats) -> Floats:
    """Unpolarised reflectance of a smooth dielectric of index 1.5 at the cosine of incidence."""
    inside = np.sqrt(1.0 - (1.0 - cos * cos) / INDEX**2)
    s, p = (cos - INDEX * inside) / (cos + INDEX * inside), (INDEX * cos - inside) / (INDEX * cos + inside)
    return np.asarray(0.5 * (s * s + p * p))


def columns(depth: Floats, reflected: Floats, blur: float) -> Floats:
    """Design (..., COLUMNS) at depths in samples: level, slope outside; body, level, slope, bend inside."""
    from scipy.special import ndtr

    there = ndtr(depth / blur)
    edge = blur * np.exp(-0.5 * (depth / blur) ** 2) / np.sqrt(2 * np.pi)
    ramp = depth * there + edge
    bend = (depth**2 + blur**2) * there + depth * edge
    return np.stack([1.0 - there, (depth - ramp) / 8.0, reflected, there, ramp / 8.0, bend / 64.0], axis=-1)
