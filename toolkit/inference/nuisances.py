"""Calibration that is known only so well: where the light stands, where the sphere lies.

Each shift is small, so around the optimum the radiance is linear in it: the shifts become columns with a Gaussian
prior from how they were calibrated, are solved for with the colours, and the scene moves by what was found until it
stands (Gauss-Newton). Their marginalisation is then in closed form.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.records import Floats, Light, Scene, Sphere

from .cells import Cells, direction_sd_rad
from .fit import Optimum, Problem, chi2_at, fit, minima, pose
from .model import columns, lit_by
from .normal import inverse, weigh

NEARNESS_SD = 0.02  # prior of 1 / distance (per sphere radius) of a light called directional, or error of a point's
RELATIVE_STEP = 1e-3  # of the prior's sd, for the differences: far above rounding, far below curvature
ROUNDS = 20
SETTLED_SD = 0.1  # posterior sds of the last move: its own error is of second order in it
SHARES = (1.0, 0.4, 0.15, 0.05)  # of a move, tried in turn
DOUBTED_SDS = 4.0  # of its prior, by which a shift says that the calibration was wrong
MISLED = 30.0  # fall of chi-square through the calibration from which the shape is searched anew
SETTLED_PRIOR_SD = 0.02  # or prior sds, where a wrong model makes the posterior absurdly narrow


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
    """Names, units and prior sds of the shifts that a scene allows."""

    names: tuple[str, ...]
    sd: Floats


def shifts_of(scene: Scene, fixed: Collection[str] = ()) -> Shifts:
    """Which shifts are free: two of each light, its nearness, two of the centre, the radius; less what is `fixed`.

    `fixed` may hold "light", "distance", "centre", "radius", or "all".
    """
    covariance = np.asarray(scene.sphere.covariance_px2)
    found: list[tuple[str, str, float]] = []
    for i, light in enumerate(scene.lights):
        tilt = direction_sd_rad(light)
        found += [("light", f"light{i}.tilt_x_rad", tilt), ("light", f"light{i}.tilt_y_rad", tilt)]
        found.append(("distance", f"light{i}.nearness_per_radius", NEARNESS_SD))
    for j, (group, name) in enumerate(
        (("centre", "sphere.centre_x_px"), ("centre", "sphere.centre_y_px"), ("radius", "sphere.radius_px"))
    ):
        found.append((group, name, float(np.sqrt(max(covariance[j, j], 0.0)))))
    free = [(name, sd) for group, name, sd in found if group not in fixed and "all" not in fixed and sd > 0]
    return Shifts(names=tuple(name for name, _ in free), sd=np.array([sd for _, sd in free]))


def doubted(optimum: Optimum, shifts: Shifts, total: Floats) -> bool:
    """Whether the photograph contradicts its calibration: a shift or a pedestal far outside its prior."""
    prior = optimum.problem.prior
    pedestal = np.array([name == "pedestal" for name, _ in optimum.problem.layout.names])
    pedestals = optimum.x[: len(pedestal)][pedestal] * np.sqrt(np.diag(prior.precision)[: len(pedestal)][pedestal])
    return bool(max(np.abs(pedestals).max(initial=0.0), np.abs(total / shifts.sd).max(initial=0.0)) > DOUBTED_SDS)


def prior_precision(scene: Scene, shifts: Shifts) -> Floats:
    """Inverse covariance of the shifts; the outline's correlations between centre and radius are kept."""
    covariance = np.diag(shifts.sd**2)
    sphere = {"sphere.centre_x_px": 0, "sphere.centre_y_px": 1, "sphere.radius_px": 2}
    for i, a in enumerate(shifts.names):
        for j, b in enumerate(shifts.names):
            if a in sphere and b in sphere:
                covariance[i, j] = scene.sphere.covariance_px2[sphere[a], sphere[b]]
    return np.asarray(np.linalg.inv(covariance))


def shifted(scene: Scene, shifts: Shifts, values: Floats) -> Scene:
    """The scene with the shifts applied."""
    by_name = dict(zip(shifts.names, values, strict=True))
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


def _shift_light(light: Light, index: int, by_name: dict[str, float]) -> Light:
    prefix = f"light{index}."
    if not any(name.startswith(prefix) for name in by_name):
        return light
    direction: Floats = np.array(light.direction, np.float64)
    position = getattr(light, "position", None)
    nearness = getattr(light, "nearness", 0.0 if position is None else 1.0 / float(np.linalg.norm(position)))
    across, along = tangents(direction)
    turned = (
        direction + by_name.get(prefix + "tilt_x_rad", 0.0) * across + by_name.get(prefix + "tilt_y_rad", 0.0) * along
    )
    turned /= np.linalg.norm(turned)
    return ShiftedLight(
        kind=light.kind,
        direction=(float(turned[0]), float(turned[1]), float(turned[2])),
        nearness=nearness + by_name.get(prefix + "nearness_per_radius", 0.0),
        irradiance=light.irradiance,
        angular_radius_deg=light.angular_radius_deg,
    )


def tangents(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors that span the plane across a direction."""
    helper = np.array([0.0, 1.0, 0.0]) if abs(direction[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    across = np.cross(helper, direction)
    across /= np.linalg.norm(across)
    return across, np.cross(direction, across)


def fit_with_shifts(problem: Problem, shifts: Shifts) -> tuple[Optimum, Floats]:
    """The optimum with the shifts free; also the shifts at which the scene came to stand.

    A wrong calibration can make a wrong shape look best, so each distinct optimum is followed; where the calibration
    then moved by much, the shape is searched once more.
    """
    nowhere = np.zeros(len(shifts.names))
    if not shifts.names:
        return fit(problem), nowhere
    starts = minima(problem)
    best, total = _best([_follow(problem, optimum, shifts, nowhere) for optimum in starts])
    if starts[0].chi2 - best.chi2 < MISLED:
        return best, total
    moved = pose(problem.model, shifted(problem.scene, shifts, total), problem.cells, problem.noise)
    return _best([(best, total), *(_follow(problem, optimum, shifts, total) for optimum in minima(moved))])


def _best(found: Sequence[tuple[Optimum, Floats]]) -> tuple[Optimum, Floats]:
    return min(found, key=lambda pair: pair[0].chi2)


def _follow(problem: Problem, optimum: Optimum, shifts: Shifts, total: Floats) -> tuple[Optimum, Floats]:
    """Gauss-Newton in the shifts, beginning at `total`; a step that makes the picture worse is shortened."""
    prior = prior_precision(problem.scene, shifts)
    for _ in range(ROUNDS):
        linear = _linearised(problem, optimum, shifts, prior, total)
        optimum = fit(linear, start=optimum)
        moved = optimum.x[len(linear.layout.names) :]
        sd = np.sqrt(np.diag(inverse(optimum.joint))[len(linear.layout.names) : linear.layout.size])
        if np.all(np.abs(moved) <= np.maximum(SETTLED_SD * sd, SETTLED_PRIOR_SD * shifts.sd)):
            return optimum, total + moved
        total = total + _share(problem, optimum, shifts, prior, total, moved) * moved
    return replace(optimum, status=f"calibration not settled after {ROUNDS} rounds"), total


def _linearised(problem: Problem, optimum: Optimum, shifts: Shifts, prior: Floats, total: Floats) -> Problem:
    """The problem with the scene shifted by `total` and further small shifts as columns."""
    return pose(
        problem.model,
        shifted(problem.scene, shifts, total),
        problem.cells,
        problem.noise,
        extras=sensitivity(optimum, problem.scene, shifts, total, problem.cells),
        extras_precision=prior,
        extras_centre=-total,
    )


def _share(problem: Problem, optimum: Optimum, shifts: Shifts, prior: Floats, total: Floats, moved: Floats) -> float:
    """How much of a move to make: all, unless the picture, not linearised, would be worse there than before."""
    weights = weigh(optimum.weights.weights, problem.extras)

    def chi2(values: Floats) -> float:
        there = pose(problem.model, shifted(problem.scene, shifts, values), problem.cells, problem.noise)
        return chi2_at(there, optimum.u, weights) + float(values @ prior @ values)

    here = chi2(total)
    return next((share for share in SHARES if chi2(total + share * moved) < here), SHARES[-1])


def sensitivity(optimum: Optimum, scene: Scene, shifts: Shifts, total: Floats, cells: Cells) -> tuple[Floats, ...]:
    """Per channel, the change of the predicted radiance with each shift (n, q), by differences."""
    problem, nodes = optimum.problem, cells.nodes()

    def predicted(values: Floats) -> list[Floats]:
        cols = columns(problem.model, problem.fresnel, lit_by(shifted(scene, shifts, values), *nodes), cells, optimum.u)
        return [c.matrix @ optimum.x[i] + c.offset for c, i in zip(cols, problem.layout.index, strict=True)]

    here = predicted(total)
    steps = np.diag(RELATIVE_STEP * shifts.sd)
    there = [predicted(total + step) for step in steps]
    return tuple(
        np.stack(
            [(moved[c] - here[c]) / step[j] for j, (moved, step) in enumerate(zip(there, steps, strict=True))], axis=1
        )
        for c in range(3)
    )
