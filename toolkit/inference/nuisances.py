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

from .gather import NEARNESS_SD, direction_sd_rad
from .moved_light import moved
from .problem import Optimum

SCALES = ("scale_red", "scale_green", "scale_blue")  # logarithms, of a light or of a whole photograph
SCALE_SD = 1.0  # of them, about a first guess: too wide to matter
RETURNED = ("returned_x", "returned_y", "returned_z")  # relative, of what comes back from around
BLUR = "camera.blur_px2"
SIZE_SD, BLUR_SD = 0.2, 0.4  # of a light's stated angular radius; of the stated second moment of a blur
DOUBTED_SDS = 4.0  # of its prior, by which a shift says that the calibration was wrong


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
    """Which shifts of one photograph are free: two of each light, its nearness, two of the centre, the radius; and what
    was stated of a light's size, of its irradiance's error, of what comes back of it from around and of the camera's
    blur.

    `fixed` may hold "light", "distance", "size", "irradiance", "returned", "blur", "centre", "radius", or "all". The
    outline's correlations are kept.
    """
    found: list[tuple[str, str, float]] = []
    for i, light in enumerate(scene.lights):
        tilt = direction_sd_rad(light)
        found += [("light", f"light{i}.tilt_x_rad", tilt), ("light", f"light{i}.tilt_y_rad", tilt)]
        found.append(("distance", f"light{i}.nearness_per_radius", NEARNESS_SD))
        size = SIZE_SD * float(np.radians(light.angular_radius_deg))
        found.append(("size", f"light{i}.angular_radius_rad", size))
        found += [("irradiance", f"light{i}.{scale}", _irradiance_error(light)) for scale in SCALES]
        back = getattr(light, "returned_sd", None) or 0.0
        found += [("returned", f"light{i}.{axis}", back) for axis in RETURNED]
    found.append(("blur", BLUR, BLUR_SD * scene.camera.blur_px2))
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


def scale_told(scene: Scene) -> bool:
    """Whether a photograph's irradiance counts as known, by a card or exactly, and is no shift."""
    return scene.scale == "absolute" and not any(_irradiance_error(light) for light in scene.lights)


def _irradiance_error(light: Light) -> float:
    """Relative sd of a stated irradiance; 0 where it counts as exactly known."""
    return getattr(light, "irradiance_relative_sd", None) or 0.0


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
    camera = replace(scene.camera, blur_px2=scene.camera.blur_px2 + by_name.get(BLUR, 0.0))
    sphere = scene.sphere
    x, y = sphere.centre_px
    there = Sphere(
        centre_px=(x + by_name.get("sphere.centre_x_px", 0.0), y + by_name.get("sphere.centre_y_px", 0.0)),
        radius_px=sphere.radius_px + by_name.get("sphere.radius_px", 0.0),
        covariance_px2=sphere.covariance_px2,
        source=sphere.source,
        given=sphere.given,
    )
    return replace(scene, camera=camera, lights=lights, sphere=there)


def brightened(scene: Scene, factor: Floats) -> Scene:
    """The scene with every light's irradiance, 1 where it is not known, multiplied per channel."""
    logs = dict(zip(SCALES, np.log(factor), strict=True))
    return replace(scene, lights=tuple(_shift_light(light, i, logs) for i, light in enumerate(scene.lights)))


def _shift_light(light: Light, index: int, by_name: dict[str, float]) -> Light:
    own = f"light{index}."
    if not any(name.startswith(own) or name in SCALES for name in by_name):
        return light
    red, green, blue = (float(np.exp(by_name.get(name, 0.0) + by_name.get(own + name, 0.0))) for name in SCALES)
    back_x, back_y, back_z = (by_name.get(own + axis, 0.0) for axis in RETURNED)
    larger = float(np.degrees(by_name.get(own + "angular_radius_rad", 0.0)))
    return moved(
        light,
        turn_rad=(by_name.get(own + "tilt_x_rad", 0.0), by_name.get(own + "tilt_y_rad", 0.0)),
        nearer_per_radius=by_name.get(own + "nearness_per_radius", 0.0),
        scale=(red, green, blue),
        angular_radius_deg=max(light.angular_radius_deg + larger, 0.0),
        returned=(back_x, back_y, back_z),
    )
