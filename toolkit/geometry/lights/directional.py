"""A light so far away that its rays are parallel: the sun, a lamp beyond a hundred sphere radii."""

from __future__ import annotations

from typing import Literal

from toolkit.geometry.repeated import repeated
from toolkit.records import Floats

from .base import Colour, Degrees, LightModel, Relative, Vector, check_irradiance, unit


class DirectionalLight(LightModel):
    """`direction` points towards the light, camera frame; normalised on reading."""

    kind: Literal["directional"] = "directional"
    direction: Vector
    direction_sd_deg: Degrees | None = None
    irradiance: Colour | None = None
    irradiance_relative_sd: Relative | None = None  # of each channel by itself; omitted: exactly known
    returned_sd: Relative | None = None  # of its irradiance, what table and walls may send back from one side
    angular_radius_deg: Degrees = 0.0

    def model_post_init(self, _: object) -> None:
        """Normalise the direction; raises ValueError on one of length zero, and on an error of nothing."""
        check_irradiance(self.irradiance, self.irradiance_relative_sd)
        object.__setattr__(self, "direction", unit(self.direction))

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Directions and irradiance, the same at every point."""
        shape, dtype = points.shape, points.dtype
        return repeated(self.direction, shape, dtype), repeated(self.irradiance or (1.0, 1.0, 1.0), shape, dtype)
