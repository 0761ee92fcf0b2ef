"""The slopes in the calibration, chained through three cosines, are those of whole pictures of moved scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.inference.fit import fit
from toolkit.inference.infer import gather_for
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifted, shifts_of
from toolkit.inference.problem import Optimum, pose
from toolkit.inference.sensitivity import sensitivity
from toolkit.records import Floats, Scene

from .ball import NOISE, photograph, radiance_of, replace_light

STEP = 1e-4  # prior sds, to either side: few nodes pass a terminator over it


def _plain(scene: Scene) -> Scene:
    return scene


def _wide_and_blurred(scene: Scene) -> Scene:
    wide = replace_light(scene, angular_radius_deg=3.0)
    return replace(wide, camera=replace(scene.camera, blur_px2=0.5))


def _lit_from_around(scene: Scene) -> Scene:
    return replace_light(scene, returned_sd=0.05)


def _near_in_a_bright_room(scene: Scene) -> Scene:
    """A near lamp with a disc, seen in perspective, of whose light some comes back from around."""
    near = _near_and_far(scene)
    lamp = near.lights[0].model_copy(update={"returned_sd": 0.05, "angular_radius_deg": 2.0})
    return replace(near, lights=(lamp,))


def _near_and_far(scene: Scene) -> Scene:
    """Two lamps, one five radii away, seen in perspective."""
    x, y, z = scene.lights[0].direction
    near = PointLight(position=(5 * x, 5 * y, 5 * z), irradiance=(3.0, 2.0, 1.0))
    far = DirectionalLight(direction=(-0.5, 0.3, 0.8), irradiance=(0.5, 0.5, 1.0))
    camera = replace(scene.camera, projection="perspective", focal_length_px=900.0, principal_point_px=(60.0, 60.0))
    return replace(scene, camera=camera, lights=(near, far))


@pytest.mark.parametrize("of", [_plain, _wide_and_blurred, _lit_from_around, _near_and_far, _near_in_a_bright_room])
@pytest.mark.parametrize("names", [("torrance-sparrow", "wolff"), ("phong", "oren-nayar"), ("mirror", "lambert")])
def test_slopes_are_those_of_pictures_of_moved_scenes(names: tuple[str, str], of: object) -> None:
    """Differences to either side of the prediction itself, in a scene that is shifted already."""
    radiance, first = radiance_of(120)
    scene = of(first)
    image = photograph(radiance, seed=1)
    problem = pose(Model.named(*names), scene, gather_for(image, scene), NOISE)
    optimum, shifts = fit(problem), shifts_of(scene)
    optimum = replace(optimum, x=np.abs(optimum.x) + 0.05)  # both lobes are to be seen
    total = 0.3 * shifts.sd * np.cos(np.arange(len(shifts.sd)))
    here = [view.moved(shifted(view.scene, shifts, total)) for view in problem.views]
    found = sensitivity(optimum, problem.views, here, shifts, total)
    for j, step in enumerate(np.diag(STEP * shifts.sd)):
        before, after = (_predicted(optimum, shifted(scene, shifts, total + sign * step)) for sign in (-1, 1))
        for slope, a, b in zip(found, before, after, strict=True):
            expected = (b - a) / (2.0 * STEP)
            error = np.abs(slope[:, j] * shifts.sd[j] - expected)
            assert np.sqrt(np.mean(error**2)) < 1e-3 * np.sqrt(np.mean(expected**2)), shifts.names[j]


def _predicted(optimum: Optimum, scene: Scene) -> tuple[Floats, ...]:
    problem = optimum.problem
    there = replace(problem, views=tuple(view.moved(scene) for view in problem.views))
    return there.predict(there.columns(optimum.u), optimum.x)
