"""Calibration that is known only so well: where the light stands, where the sphere lies.

Each is a small shift with a Gaussian prior from how it was calibrated; `settle` finds them with the fit, and since the
radiance is linear in them around the optimum their marginalisation is in closed form.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from toolkit.records import Floats, Light, Scene, Sphere, scale_of

from .gather import direction_sd_rad
from .problem import Optimum

SCALES = ("scale_red", "scale_green", "scale_blue")  # logarithms, of a photograph whose irradiance is not known
SCALE_SD = 1.0  # of them, about a first guess: too wide to matter
NEARNESS_SD = 0.02  # prior of 1 / distance (per sphere radius) of a light called directional, or error of a point's
DOUBTED_SDS = 4.0  # of its prior, by which a shift says that the calibration was wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class ShiftedLight:
    """Any light, turned by small angles about two axes and brought nearer; agrees with the kinds where they meet.

    A light in direction d at distance 1 / nearness shines on point p along d - nearness p.
    """

    kind: str
    direction: tuple[float, float, float]
    nearness: float
    irradiance: tuple[float, float, float] | None
    angular_radius_deg: float

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Directions and irradiance at surface points, as every light gives them."""
        towards = np.asarray(self.direction) - self.nearness * np.asarray(points)
        square = np.einsum("...i,...i->...", towards, towards)[..., None]
        return towards / np.sqrt(square), np.asarray(self.irradiance or (1.0, 1.0, 1.0)) / square


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shifts:
    """The shifts that are free: names with units, which photograph each is of, and their Gaussian prior about 0."""

    names: tuple[str, ...]
    photograph: NDArray[np.intp]
    covariance: Floats

    @property
    def sd(self) -> Floats:
        """Prior sds."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def precision(self) -> Floats:
        """Inverse of the prior's covariance."""
        return np.asarray(np.linalg.inv(self.covariance))

    def of(self, photograph: int, values: Floats) -> dict[str, float]:
        """One photograph's shifts by their names without its number."""
        mine = np.flatnonzero(self.photograph == photograph)
        return {self.names[i].removeprefix(prefix(photograph)): float(values[i]) for i in mine}


def prefix(photograph: int) -> str:
    """What the names of a photograph's own shifts begin with: nothing for the first."""
    return f"photograph{photograph + 1}." if photograph else ""


def shifts_of(scene: Scene, fixed: Collection[str] = ()) -> Shifts:
    """Which shifts of one photograph are free: two of each light, its nearness, two of the centre, the radius.

    `fixed` may hold "light", "distance", "centre", "radius", or "all". The outline's correlations are kept.
    """
    found: list[tuple[str, str, float]] = []
    for i, light in enumerate(scene.lights):
        tilt = direction_sd_rad(light)
        found += [("light", f"light{i}.tilt_x_rad", tilt), ("light", f"light{i}.tilt_y_rad", tilt)]
        found.append(("distance", f"light{i}.nearness_per_radius", NEARNESS_SD))
    lights = len(found)
    outline = np.asarray(scene.sphere.covariance_px2)
    for j, (group, name) in enumerate(
        (("centre", "sphere.centre_x_px"), ("centre", "sphere.centre_y_px"), ("radius", "sphere.radius_px"))
    ):
        found.append((group, name, float(np.sqrt(max(outline[j, j], 0.0)))))
    covariance = block_diag(np.diag([sd**2 for _, _, sd in found[:lights]]), outline)
    free = [i for i, (group, _, sd) in enumerate(found) if group not in fixed and "all" not in fixed and sd > 0]
    return Shifts(
        names=tuple(found[i][1] for i in free),
        photograph=np.zeros(len(free), np.intp),
        covariance=covariance[np.ix_(free, free)],
    )


def shifts_of_all(scenes: Sequence[Scene], fixed: Collection[str] = ()) -> Shifts:
    """The shifts of several photographs of one material: each one's own, and the scale of what has none.

    A photograph whose irradiance is not known has three numbers more, the logarithm of each channel's scale; where
    none is known, the first one's stands for the unit.
    """
    each = [shifts_of(scene, fixed) for scene in scenes]
    unit = None if scale_of(scenes) == "absolute" else 0
    for v, scene in enumerate(scenes):
        if scene.scale == "relative" and v != unit:
            mine = each[v]
            each[v] = Shifts(
                names=(*mine.names, *SCALES),
                photograph=np.zeros(len(mine.names) + 3, np.intp),
                covariance=block_diag(mine.covariance, np.eye(3) * SCALE_SD**2),
            )
    return Shifts(
        names=tuple(prefix(v) + name for v, mine in enumerate(each) for name in mine.names),
        photograph=np.repeat(np.arange(len(each)), [len(mine.names) for mine in each]),
        covariance=block_diag(np.zeros((0, 0)), *(mine.covariance for mine in each)),
    )


def doubted(optimum: Optimum, shifts: Shifts, total: Floats) -> bool:
    """Whether the photograph contradicts its calibration: a shift or a pedestal far outside its prior."""
    prior = optimum.problem.prior
    pedestal = np.array([name.startswith("pedestal") for name, _ in optimum.problem.layout.names])
    pedestals = optimum.x[: len(pedestal)][pedestal] * np.sqrt(np.diag(prior.precision)[: len(pedestal)][pedestal])
    return bool(max(np.abs(pedestals).max(initial=0.0), np.abs(total / shifts.sd).max(initial=0.0)) > DOUBTED_SDS)


def shifted(scene: Scene, shifts: Shifts, values: Floats, photograph: int = 0) -> Scene:
    """A photograph's scene with its shifts applied."""
    by_name = shifts.of(photograph, values)
    if not by_name:
        return scene
    lights = tuple(_shift_light(light, i, by_name) for i, light in enumerate(scene.lights))
    sphere = scene.sphere
    x, y = sphere.centre_px
    moved = Sphere(
        centre_px=(x + by_name.get("sphere.centre_x_px", 0.0), y + by_name.get("sphere.centre_y_px", 0.0)),
        radius_px=sphere.radius_px + by_name.get("sphere.radius_px", 0.0),
        covariance_px2=sphere.covariance_px2,
        source=sphere.source,
        given=sphere.given,
    )
    return replace(scene, lights=lights, sphere=moved)


def brightened(scene: Scene, factor: Floats) -> Scene:
    """The scene with every light's irradiance, 1 where it is not known, multiplied per channel."""
    logs = dict(zip(SCALES, np.log(factor), strict=True))
    return replace(scene, lights=tuple(_shift_light(light, i, logs) for i, light in enumerate(scene.lights)))


def _shift_light(light: Light, index: int, by_name: dict[str, float]) -> Light:
    own = f"light{index}."
    if not any(name.startswith(own) or name in SCALES for name in by_name):
        return light
    direction: Floats = np.array(light.direction, np.float64)
    position = getattr(light, "position", None)
    nearness = getattr(light, "nearness", 0.0 if position is None else 1.0 / float(np.linalg.norm(position)))
    across, along = tangents(direction)
    turned = direction + by_name.get(own + "tilt_x_rad", 0.0) * across + by_name.get(own + "tilt_y_rad", 0.0) * along
    turned /= np.linalg.norm(turned)
    return ShiftedLight(
        kind=light.kind,
        direction=(float(turned[0]), float(turned[1]), float(turned[2])),
        nearness=nearness + by_name.get(own + "nearness_per_radius", 0.0),
        irradiance=_scaled(light, by_name),
        angular_radius_deg=light.angular_radius_deg,
    )


def _scaled(light: Light, by_name: dict[str, float]) -> tuple[float, float, float] | None:
    """A light's irradiance times its photograph's scale; None stays so where there is no such number."""
    if not any(name in by_name for name in SCALES):
        return light.irradiance
    factor = [float(np.exp(by_name.get(name, 0.0))) for name in SCALES]
    red, green, blue = (e * f for e, f in zip(light.irradiance or (1.0, 1.0, 1.0), factor, strict=True))
    return red, green, blue


def tangents(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that span the plane across a direction."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(helper, direction)
    across /= np.linalg.norm(across)
    return across, np.cross(direction, across)
