"""Where a near lamp stands: the rays that two or more mirror balls send to it, met.

Solved for the lamp's direction from the first ball's centre and one over its distance, which stays finite for a lamp
however far; the errors of every highlight and every outline are carried through, those of balls that share nothing
taken as independent. All balls are of one size; a perspective camera sees their distances from it, an orthographic one
takes them as standing side by side at the same distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.records import Camera, Floats, Sphere, readonly

from .chrome import STEP_PX, LampFound, mirrored
from .sphere import centre_position, surface

NEAR = 2.5  # sds that one over the distance must lie above zero for a distance to be stated
DIVERGING = 5.0  # sds below zero, beyond which the rays do not come from any place
SAME_LAMP_CHI2 = 16.0  # per degree of freedom, beyond which the rays belong to different lamps


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LampPlaced:
    """Direction from the first ball's centre and one over the distance in ball radii; `covariance` (3, 3) is of two
    turns of the direction, rad, and of that inverse distance; `across` (2, 3) the axes of the turns.
    """

    direction: tuple[float, float, float]
    per_distance: float
    covariance: Floats
    across: Floats
    chi2_reduced: float

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def same_lamp(self) -> bool:
        """Whether the rays can meet at all."""
        return self.chi2_reduced < SAME_LAMP_CHI2

    @property
    def near(self) -> bool:
        """Whether the distance can be told."""
        return self.per_distance > NEAR * float(np.sqrt(self.covariance[2, 2]))

    @property
    def diverging(self) -> bool:
        """Whether the rays part towards the lamp by more than their errors allow."""
        return self.per_distance < -DIVERGING * float(np.sqrt(self.covariance[2, 2]))

    @property
    def position(self) -> tuple[float, float, float]:
        """In radii from the first ball's centre; only where `near`."""
        x, y, z = (float(v) / self.per_distance for v in self.direction)
        return x, y, z

    @property
    def position_covariance(self) -> Floats:
        """Of `position` (3, 3), radii^2."""
        slopes = np.column_stack([self.across.T, -np.asarray(self.direction) / self.per_distance]) / self.per_distance
        return np.asarray(slopes @ self.covariance @ slopes.T)

    @property
    def distance(self) -> tuple[float, float]:
        """In radii, and its sd; only where `near`."""
        sd = float(np.sqrt(self.covariance[2, 2]))
        return 1.0 / self.per_distance, sd / self.per_distance**2

    @property
    def least_distance(self) -> float:
        """What the distance hardly undercuts, radii."""
        return float(1.0 / max(self.per_distance + 2.0 * np.sqrt(self.covariance[2, 2]), 1e-6))

    @property
    def sd_deg(self) -> float:
        """Standard deviation of the direction, each axis."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[:2, :2]) / 2.0)))


def place_lamp(lamps: Sequence[LampFound]) -> LampPlaced:
    """One lamp from its images in two or more balls, or in one ball at two or more places."""
    from scipy.optimize import least_squares

    numbers = np.concatenate([[*lamp.image.place_px, *lamp.sphere.centre_px, lamp.sphere.radius_px] for lamp in lamps])
    camera = lamps[0].camera
    first = np.mean([lamp.direction for lamp in lamps], axis=0)
    towards = first / np.linalg.norm(first)
    state, fit = np.zeros(3), None
    for _ in range(3):  # the weights, too, depend on where the lamp stands
        axes = _across(towards)
        whiten = np.linalg.inv(np.linalg.cholesky(_covariance(state, towards, axes, numbers, camera, lamps)))
        arguments = (towards, axes, numbers, camera, whiten)
        fit = least_squares(_whitened, state, args=arguments, x_scale=[0.1, 0.1, 0.1])
        turned = towards + fit.x[:2] @ axes
        towards, state = turned / np.linalg.norm(turned), np.array([0.0, 0.0, fit.x[2]])
    result: Any = fit
    chi2 = 2 * result.cost / max(2 * len(lamps) - 3, 1)
    x, y, z = (float(v) for v in towards)
    return LampPlaced(
        direction=(x, y, z),
        per_distance=float(state[2]),
        covariance=np.linalg.pinv(result.jac.T @ result.jac) * max(chi2, 1.0),
        across=axes,
        chi2_reduced=float(chi2),
    )


def _across(towards: Floats) -> Floats:
    """Two unit vectors (2, 3) at right angles to a third and to each other."""
    helper = np.eye(3)[int(np.argmin(np.abs(towards)))]
    a = np.cross(towards, helper)
    a /= np.linalg.norm(a)
    return np.stack([a, np.cross(towards, a)])


def _misses(q: Floats, towards: Floats, axes: Floats, numbers: Floats, camera: Camera) -> Floats:
    """By how much (rad, two a ball) the lamp lies beside the rays; exact also where it lies far behind one."""
    points, rays = _rays(numbers, camera)
    seen = towards + q[:2] @ axes - q[2] * points
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    return np.concatenate([_across(ray) @ lamp for ray, lamp in zip(rays, seen, strict=True)])


def _whitened(q: Floats, towards: Floats, axes: Floats, numbers: Floats, camera: Camera, whiten: Floats) -> Floats:
    return np.asarray(whiten @ _misses(q, towards, axes, numbers, camera))


def _rays(numbers: Floats, camera: Camera) -> tuple[Floats, Floats]:
    """The mirroring points, radii from the first ball's centre, and the rays that leave there; (N, 3) each."""
    points, rays, origin = [], [], None
    for x, y, cx, cy, radius in numbers.reshape(-1, 5):
        centre_px = (float(cx), float(cy))
        sphere = Sphere(centre_px=centre_px, radius_px=float(radius), covariance_px2=np.zeros((3, 3)), source="given")
        centre = _centre(camera, sphere)
        origin = centre if origin is None else origin
        at = np.array([x]), np.array([y])
        points.append(centre - origin + surface(camera, sphere, *at).normal[0])
        rays.append(mirrored(camera, sphere, *at)[0])
    return np.array(points), np.array(rays)


def _centre(camera: Camera, sphere: Sphere) -> Floats:
    if camera.projection == "perspective":
        return centre_position(camera, sphere)
    return np.array([sphere.centre_px[0], -sphere.centre_px[1], 0.0]) / sphere.radius_px


def _covariance(
    state: Floats, towards: Floats, axes: Floats, numbers: Floats, camera: Camera, lamps: Sequence[LampFound]
) -> Floats:
    """Of the misses (2N, 2N), from those of highlights and outlines."""
    steps = STEP_PX * np.eye(len(numbers))
    slopes = np.stack(
        [
            (_misses(state, towards, axes, numbers + h, camera) - _misses(state, towards, axes, numbers - h, camera))
            / (2 * STEP_PX)
            for h in steps
        ],
        axis=1,
    )
    known = np.zeros((len(numbers), len(numbers)))
    for i, lamp in enumerate(lamps):
        known[5 * i : 5 * i + 2, 5 * i : 5 * i + 2] = lamp.image.covariance_px2
        known[5 * i + 2 : 5 * i + 5, 5 * i + 2 : 5 * i + 5] = lamp.sphere.covariance_px2
    return np.asarray(slopes @ known @ slopes.T + 1e-14 * np.eye(len(slopes)))
