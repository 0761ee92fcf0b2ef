"""Where a lamp stands, read off a mirror ball: the view mirrored at the middle of the lamp's image.

The highlight's place tells the surface's normal n there; the lamp lies in the mirrored direction 2 (n.v) n - v, twice
as far from the view as the normal. Errors of the highlight's place and of the ball's outline are carried through.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Camera, Floats, LinearImage, Sphere, readonly

from .chrome_disc import LampImage, fit_lamp_image
from .chrome_spot import find_spot
from .sphere import surface

STEP_PX = 1e-3  # of derivatives
UNRESOLVED = 0.35  # relative sd of a radius from which on it is only an upper limit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LampFound:
    """A lamp seen in one ball: direction from the place on the ball that mirrors it, camera frame.

    `covariance` (3, 3) is of the unit vector, rad^2, its own direction excluded; `highlight_covariance` is the part of
    it that the highlight's place brings, the rest is the outline's.
    """

    camera: Camera
    sphere: Sphere
    image: LampImage
    direction: tuple[float, float, float]
    covariance: Floats
    highlight_covariance: Floats

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def sd_deg(self) -> float:
        """Standard deviation in each of the two directions across."""
        return sd_across_deg(self.covariance)

    @property
    def angular_radius_deg(self) -> float | None:
        """The lamp's angular radius; None where blur or clipping hide it."""
        known = self.image.radius_relative_sd < UNRESOLVED
        return float(np.degrees(self.image.lamp_radius_rad)) if known else None

    @property
    def angular_radius_limit_deg(self) -> float:
        """What the radius hardly exceeds: two sd above the best one."""
        return float(np.degrees(self.image.lamp_radius_rad * np.exp(2.0 * min(self.image.radius_relative_sd, 1.5))))


def lamp_in_ball(image: LinearImage, *, sphere: Sphere, camera: Camera) -> LampFound:
    """The lamp whose image is the brightest thing that the ball mirrors.

    Raises BadInputError where there is no highlight, where it lies outside the ball, or everything is clipped.
    """
    spot = find_spot(image, sphere=sphere, camera=camera)
    seen = fit_lamp_image(image, spot, sphere=sphere, camera=camera)
    by_place, by_sphere = _slopes(camera, sphere, seen.place_px)
    of_highlight = by_place @ seen.covariance_px2 @ by_place.T
    x, y, z = (float(v) for v in mirrored(camera, sphere, *_arrays(seen.place_px))[0])
    return LampFound(
        camera=camera,
        sphere=sphere,
        image=seen,
        direction=(x, y, z),
        covariance=of_highlight + by_sphere @ sphere.covariance_px2 @ by_sphere.T,
        highlight_covariance=of_highlight,
    )


def mirrored(camera: Camera, sphere: Sphere, x_px: Floats, y_px: Floats) -> Floats:
    """Unit directions (N, 3) that a mirror ball shows at pixel coordinates (N,): 2 (n.v) n - v."""
    seen = surface(camera, sphere, x_px, y_px)
    cosine = np.einsum("...i,...i->...", seen.normal, seen.view)[..., None]
    return np.asarray(2.0 * cosine * seen.normal - seen.view)


def sd_across_deg(covariance: Floats) -> float:
    """The sd of a unit vector in each of the two directions across, from its covariance (3, 3)."""
    return float(np.degrees(np.sqrt(max(np.trace(covariance) / 2.0, 0.0))))


def _slopes(camera: Camera, sphere: Sphere, place_px: tuple[float, float]) -> tuple[Floats, Floats]:
    """Derivatives of the mirrored direction by the highlight's place (3, 2), and by centre and radius (3, 3)."""
    start = np.array([*place_px, *sphere.centre_px, sphere.radius_px])
    columns = [(_direction(camera, start + h) - _direction(camera, start - h)) / (2 * STEP_PX) for h in _STEPS]
    both = np.stack(columns, axis=1)
    return both[:, :2], both[:, 2:]


_STEPS = STEP_PX * np.eye(5)


def _direction(camera: Camera, numbers: Floats) -> Floats:
    """The mirrored direction (3,) from place, centre and radius (5,)."""
    x, y, cx, cy, radius = (float(v) for v in numbers)
    sphere = Sphere(centre_px=(cx, cy), radius_px=radius, covariance_px2=np.zeros((3, 3)), source="given")
    return np.asarray(mirrored(camera, sphere, np.array([x]), np.array([y]))[0])


def _arrays(place_px: tuple[float, float]) -> tuple[Floats, Floats]:
    return np.array([place_px[0]]), np.array([place_px[1]])
