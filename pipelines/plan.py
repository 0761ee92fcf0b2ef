"""What a photograph could tell before it is taken, and under which second light another one would help most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from synthetic.lights import movable, moved
from synthetic.materials import Material
from synthetic.scenes import direction, exposed
from toolkit.inference.expected import expected_view
from toolkit.inference.fisher import bound_sds
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifts_of_all
from toolkit.inference.problem import pose_views
from toolkit.inference.views import View
from toolkit.records import Floats, Noise, Scene, readonly
from toolkit.reflectance.fresnel import dielectric_f0

OFF_AXIS_DEG = (10.0, 25.0, 40.0, 55.0, 70.0, 85.0, 100.0, 115.0, 130.0)
AROUND_DEG = (0.0, 90.0, 180.0, 270.0)  # from the first light's side
HIGHLIGHT = 0.8  # of saturation, where no exposure is asked for
UNKNOWN_SD = 12**-0.5  # of a number from 0 to 1 of which nothing is known


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """The photograph to be taken: its scene, what the sphere is made of, the camera's frame and noise."""

    scene: Scene
    material: Material
    noise: Noise  # in image units
    width_px: int
    height_px: int
    format: Literal["dng", "png", "exr"]
    exposure: float | None  # image units per radiance; None: the highlight at 0.8 of saturation
    neutral: bool = False
    fixed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Second:
    """A second photograph under a light at `direction`: the sds that both together leave, by parameter."""

    direction: tuple[float, float, float]
    off_axis_deg: float
    sds: Mapping[str, Floats]
    gain: float  # mean over the parameters of the logarithm by which their sds fall


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Expected sds by parameter, (1,) or (3,): with the calibration's errors, and by the noise alone.

    `seconds` are all second lights tried, the most useful one first; `repeated` is the same photograph once more.
    """

    truth: Mapping[str, Floats]
    sds: Mapping[str, Floats]
    noise_sds: Mapping[str, Floats]
    seconds: tuple[Second, ...]
    repeated: Second

    def __post_init__(self) -> None:
        readonly(self)


def plan(setup: Setup) -> Plan:
    """The bound for one photograph, and for two under each of a ring of second lights.

    The second photograph has the first one's camera, sphere and lamp, moved; its light and outline are known no
    better. Raises TypeError where the first light cannot be moved.
    """
    model, truth = _model(setup), _truth(setup.material)
    first = _view(setup, model, truth, setup.scene)
    alone = _sds(model, [first], truth, setup.fixed)
    x, y, _ = movable(setup.scene.lights[0]).direction
    side_deg = float(np.degrees(np.arctan2(y, x)))
    seconds = []
    for off in OFF_AXIS_DEG:
        for around in AROUND_DEG:
            scene = _lit_from(setup.scene, direction(off, side_deg + around))
            both = [first, _view(setup, model, truth, scene)]
            seconds.append(_second(scene, _sds(model, both, truth, setup.fixed), alone))
    return Plan(
        truth=truth,
        sds=alone,
        noise_sds=_sds(model, [first], truth, ("all",)),
        seconds=tuple(sorted(seconds, key=lambda one: -one.gain)),
        repeated=_second(setup.scene, _sds(model, [first, first], truth, setup.fixed), alone),
    )


def _model(setup: Setup) -> Model:
    made_of = setup.material
    exact = {"fresnel": "dielectric"} if "specular_index" in made_of.colours else {}
    return Model.named(made_of.model, made_of.diffuse, {**made_of.variant, **exact}, neutral=setup.neutral)


def _truth(made_of: Material) -> dict[str, Floats]:
    """The material's numbers by a result's names."""
    found = {name: np.atleast_1d(value) for name, value in made_of.shape.items()}
    for name, colour in made_of.colours.items():
        found["specular_f0" if name == "specular_index" else name] = (
            dielectric_f0(colour) if name == "specular_index" else colour
        )
    if "specular_strength" in found:  # F the same at every angle: as good as an F0 of that
        found["specular_f0"] = found.pop("specular_strength")
    return found


def _view(setup: Setup, model: Model, truth: Mapping[str, Floats], scene: Scene) -> View:
    def at_exposure(brightest: float) -> Scene:
        factor = setup.exposure or HIGHLIGHT / max(brightest, 1e-300)
        return replace(exposed(scene, factor), scale=scene.scale)

    return expected_view(
        model,
        scene,
        setup.noise,
        truth,
        width_px=setup.width_px,
        height_px=setup.height_px,
        mosaic=setup.format == "dng",
        white=np.inf if setup.format == "exr" else 1.0,
        exposed=at_exposure,
    )


def _sds(model: Model, views: Sequence[View], truth: Mapping[str, Floats], fixed: tuple[str, ...]) -> dict[str, Floats]:
    """The bound's sds of the numbers that a reader asks for."""
    problem = pose_views(model, views)
    shifts = shifts_of_all([view.scene for view in views], fixed)
    found = bound_sds(problem, truth, shifts)
    hidden = ("pedestal", "specular_scale")
    return {name: sd for name, sd in found.items() if not name.startswith(hidden)}


def _lit_from(scene: Scene, towards: tuple[float, float, float]) -> Scene:
    """The scene under its first light alone, moved to shine from elsewhere, as far away as before."""
    light = movable(scene.lights[0])
    place = getattr(light, "position", None)
    far = 1.0 if place is None else float(np.linalg.norm(place))
    return replace(scene, lights=(moved(light, far * np.asarray(towards)),))


def _second(scene: Scene, sds: Mapping[str, Floats], alone: Mapping[str, Floats]) -> Second:
    x, y, z = movable(scene.lights[0]).direction
    shared = [name for name in sds if name in alone or name == "specular_f0"]
    before = [np.log(np.mean(alone.get(name, np.array([UNKNOWN_SD])))) for name in shared]
    after = [np.log(np.mean(sds[name])) for name in shared]
    return Second(
        direction=(x, y, z),
        off_axis_deg=float(np.degrees(np.arccos(np.clip(z, -1.0, 1.0)))),
        sds=sds,
        gain=float(np.mean(np.subtract(before, after))),
    )
