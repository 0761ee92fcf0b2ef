"""What the best fit made of the lights: direction, distance, how sure that is, irradiance and what comes back of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.inference.moved_light import Vector, returned_of
from toolkit.records import Fit, Light


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLight:
    """`position` in sphere radii, None for a light far away; `sd_deg` of the direction, about each of two axes.

    `irradiance` is None where it is not known; `returned`.n, of the irradiance, comes back from around on a normal n.
    """

    direction: Vector
    position: Vector | None
    sd_deg: float | None
    irradiance: Vector | None
    returned: Vector | None


def fitted_light(fit: Fit, index: int) -> FittedLight:
    """One light of a fit's scene."""
    light = fit.scene.lights[index]
    returned = returned_of(light)
    return FittedLight(
        direction=_direction(light),
        position=_position(light),
        sd_deg=_sd_deg(fit, index, light),
        irradiance=light.irradiance,
        returned=returned if any(returned) else None,
    )


def _direction(light: Light) -> Vector:
    x, y, z = (float(value) for value in light.at(np.zeros((1, 3)))[0][0])
    return x, y, z


def _position(light: Light) -> Vector | None:
    """Where a light of kind "point" stands; a fitted one carries 1 / distance instead."""
    if light.kind != "point":
        return None
    given, nearness = getattr(light, "position", None), getattr(light, "nearness", 0.0)
    if given is None and nearness > 0.0:
        given = [value / nearness for value in _direction(light)]
    return None if given is None else (float(given[0]), float(given[1]), float(given[2]))


def _sd_deg(fit: Fit, index: int, light: Light) -> float | None:
    tilts = [fit.nuisances[name][1] for name in _tilts(index) if name in fit.nuisances]
    if tilts:
        return math.degrees(math.sqrt(sum(sd * sd for sd in tilts) / len(tilts)))
    stated = getattr(light, "direction_sd_deg", None)
    return None if stated is None else float(stated)


def _tilts(index: int) -> tuple[str, str]:
    return f"light{index}.tilt_x_rad", f"light{index}.tilt_y_rad"
