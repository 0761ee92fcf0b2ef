"""A small light at a known place: a lamp on the table, a flash beside the camera."""

from __future__ import annotations

from typing import Literal

import numpy as np

from toolkit.records import Floats

from .base import Colour, Degrees, LightModel, Relative, Vector, check_irradiance, unit


class PointLight(LightModel):
    """`position` in sphere radii from the sphere's centre, camera frame; irradiance is that at the centre."""

    kind: Literal["point"] = "point"
    position: Vector
    direction_sd_deg: Degrees | None = None
    irradiance: Colour | None = None
    irradiance_relative_sd: Relative | None = None  # of each channel by itself; omitted: exactly known
    returned_sd: Relative | None = None  # of its irradiance, what table and walls may send back from one side
    angular_radius_deg: Degrees = 0.0  # as seen from the sphere's centre

    def model_post_init(self, _: object) -> None:
        """Refuse a light inside the sphere, and an error of nothing."""
        check_irradiance(self.irradiance, self.irradiance_relative_sd)
        if np.linalg.norm(self.position) <= 1.0:
            raise ValueError(f"light position {self.position} lies inside the sphere; expected beyond 1 sphere radius")

    @property
    def direction(self) -> Vector:
        """Unit vector from the sphere's centre towards the light."""
        return unit(self.position)

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Directions from each point, and irradiance that falls off with the squared distance."""
        towards = np.asarray(self.position, points.dtype) - points
        distance2 = np.einsum("...i,...i->...", towards, towards)[..., None]
        falloff = float(np.dot(self.position, self.position)) / distance2
        return towards / np.sqrt(distance2), falloff * np.asarray(self.irradiance or (1.0, 1.0, 1.0), points.dtype)
