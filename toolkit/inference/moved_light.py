"""Any light a little other than it was: turned, nearer, brighter, lit from around, or a part of its disc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.geometry.repeated import repeated
from toolkit.geometry.tangents import tangents
from toolkit.records import Floats, Light

Vector = tuple[float, float, float]

PARTS = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))  # of a disc, by the sides of its centre


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedLight:
    """Any light, turned by small angles about two axes and brought nearer; agrees with the kinds where they meet.

    A light in direction d at distance 1 / nearness shines on point p along d - nearness p. What stands around may send
    back some of it: on a surface of normal n the irradiance `returned`.n, relative to the light's own.
    """

    kind: str
    direction: Vector
    nearness: float
    irradiance: Vector | None
    angular_radius_deg: float
    returned: Vector = (0.0, 0.0, 0.0)

    @property
    def colour(self) -> Vector:
        """Its irradiance at the sphere's centre; 1 where it is not known."""
        return self.irradiance or (1.0, 1.0, 1.0)

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Directions and irradiance at surface points, as every light gives them."""
        if self.nearness == 0.0:
            shape, dtype = points.shape, points.dtype
            return repeated(self.direction, shape, dtype), repeated(self.colour, shape, dtype)
        towards = self.nearness * np.moveaxis(points, -1, 0)
        for d, component in zip(self.direction, towards, strict=True):
            np.subtract(d, component, out=component)
        square = towards[0] * towards[0] + towards[1] * towards[1] + towards[2] * towards[2]
        towards /= np.sqrt(square)
        colour = np.asarray(self.colour, points.dtype)
        irradiance = np.multiply.outer(colour, 1.0 / square)
        return np.moveaxis(towards, 0, -1), np.moveaxis(irradiance, 0, -1)


def moved(
    light: Light,
    *,
    turn_rad: tuple[float, float] = (0.0, 0.0),
    nearer_per_radius: float = 0.0,
    scale: Vector = (1.0, 1.0, 1.0),
    angular_radius_deg: float | None = None,
    returned: Vector = (0.0, 0.0, 0.0),
) -> MovedLight:
    """The light turned about two axes across its direction, nearer, of `scale` times the irradiance (1 if unknown).

    `returned` is what comes back from around, more than before.
    """
    direction: Floats = np.array(light.direction, np.float64)
    position = getattr(light, "position", None)
    nearness = getattr(light, "nearness", 0.0 if position is None else 1.0 / float(np.linalg.norm(position)))
    across, along = tangents(direction)
    turned = direction + turn_rad[0] * across + turn_rad[1] * along
    turned /= np.sqrt(turned @ turned)
    irradiance, before = light.irradiance, returned_of(light)
    if scale != (1.0, 1.0, 1.0):
        red, green, blue = (e * f for e, f in zip(irradiance or (1.0, 1.0, 1.0), scale, strict=True))
        irradiance = red, green, blue
    return MovedLight(
        kind=light.kind,
        direction=(float(turned[0]), float(turned[1]), float(turned[2])),
        nearness=nearness + nearer_per_radius,
        irradiance=irradiance,
        angular_radius_deg=light.angular_radius_deg if angular_radius_deg is None else angular_radius_deg,
        returned=(before[0] + returned[0], before[1] + returned[1], before[2] + returned[2]),
    )


def returned_of(light: Light) -> Vector:
    """What comes back of a light from around, relative: none as it is told."""
    return getattr(light, "returned", (0.0, 0.0, 0.0))


def parts(light: Light) -> tuple[Light, ...]:
    """A light's disc as four small ones of the disc's own second moments, a quarter of its irradiance each.

    Gauss's two-point rule along each axis: half the radius aside. A light without extent is left as it is.
    """
    if light.angular_radius_deg == 0.0:
        return (light,)
    aside = 0.5 * float(np.radians(light.angular_radius_deg))
    quarter = (0.25, 0.25, 0.25)
    return tuple(moved(light, turn_rad=(x * aside, y * aside), scale=quarter, angular_radius_deg=0.0) for x, y in PARTS)
