"""Light that a table sends back from below: stated, the lamp stays where it is; not stated, it is taken for a tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.geometry.sphere import surface
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.layers import predict
from toolkit.inference.model import Model
from toolkit.inference.moved_light import moved
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.problem import pose
from toolkit.records import Fit, Floats, Scene

from .ball import BODY, NOISE, photograph, radiance_of, replace_light

SIZE_PX, RETURNED = 160, (0.004, -0.02, 0.0)  # of the lamp's irradiance


def above_a_table() -> tuple[Floats, Scene]:
    """A glossy ball's radiance with what its body makes of the light from below, and its scene: the lamp alone."""
    radiance, scene = radiance_of(SIZE_PX, "ggx", alpha=0.1)
    y, x = np.indices(radiance.shape[:2])
    seen = surface(scene.camera, scene.sphere, x.ravel(), y.ravel())
    irradiance = np.where(seen.on_sphere, seen.normal @ np.array(RETURNED), 0.0).reshape(radiance.shape[:2])
    assert scene.lights[0].irradiance is not None
    return radiance + irradiance[..., None] * np.array(BODY) * scene.lights[0].irradiance / np.pi, scene


def fitted(radiance: Floats, scene: Scene, returned_sd: float | None) -> Fit:
    told = replace_light(scene, returned_sd=returned_sd)
    image = photograph(radiance, seed=1, mosaic=False)
    return infer(image, told, gather_for(image, told), Model.named("ggx"), seed=1, effective=200)


def test_a_table_below_does_not_turn_the_lamp() -> None:
    """Told of, the lamp is found where it stands, and light from below; untold, it is turned several times more."""
    radiance, scene = above_a_table()
    told, untold = (fitted(radiance, scene, sd) for sd in (0.02, None))
    for axis, truth in zip("xyz", RETURNED, strict=True):
        value, sd = told.nuisances[f"light0.returned_{axis}"]
        assert abs(value - truth) < 3.0 * sd
    assert told.nuisances["light0.returned_y"][1] < 0.004
    turned, stayed = (
        np.hypot(*(fit.nuisances[f"light0.tilt_{axis}_rad"][0] for axis in "xy")) for fit in (untold, told)
    )
    assert stayed < 0.002 < 0.004 < turned
    assert told.chi2_reduced < 1.1 < untold.chi2_reduced


def test_what_comes_back_is_part_of_the_body() -> None:
    """The predicted picture holds it: below, the body is brighter by what the shifts say."""
    radiance, scene = above_a_table()
    found = fitted(radiance, scene, 0.02)
    x, y = (np.array([value]) for value in scene.sphere.centre_px)
    below = y + 0.6 * scene.sphere.radius_px
    plain = tuple(replace(light, returned=(0.0, 0.0, 0.0)) for light in found.scene.lights)  # type: ignore[type-var]
    dark = replace(found, scene=replace(found.scene, lights=plain))
    more = predict(found, x, below).diffuse - predict(dark, x, below).diffuse
    back = [found.nuisances[f"light0.returned_{axis}"][0] for axis in "xyz"]
    normal = np.array([0.0, -0.6, 0.8])
    expected = np.array(found.scene.lights[0].irradiance) * found.colours["diffuse_albedo"] / np.pi * (normal @ back)
    assert np.allclose(more[0], expected, rtol=0.05)


def test_no_layer_is_below_nothing() -> None:
    """Where less than nothing would come back, on the side away from the table and in shadow, nothing does."""
    _, scene = above_a_table()
    found = fitted(above_a_table()[0], scene, 0.02)
    (cx, cy), reach = scene.sphere.centre_px, 0.9 * scene.sphere.radius_px
    x, y = (of.ravel() for of in np.meshgrid(cx + np.linspace(-reach, reach, 41), cy + np.linspace(-reach, reach, 41)))
    assert predict(found, x, y).diffuse.min() >= 0.0


def test_nothing_comes_back_unless_stated() -> None:
    """It is free where it was stated, and not fixed."""
    _, scene = above_a_table()
    told = replace_light(scene, returned_sd=0.02)
    own = {f"light0.returned_{axis}" for axis in "xyz"}
    assert not own & set(shifts_of(scene).names)
    assert own < set(shifts_of(told).names)
    assert not own & set(shifts_of(told, ("returned",)).names)


def test_columns_hold_it_with_their_slopes_and_without() -> None:
    """A step of the fit, which asks for slopes too, and a prediction see the same picture."""
    radiance, scene = above_a_table()
    light = moved(scene.lights[0], returned=(0.0, -0.02, 0.01))
    lit_from_below = replace(scene, lights=(light,))
    image = photograph(radiance, seed=1, mosaic=False)
    problem = pose(Model.named("ggx", "wolff"), lit_from_below, gather_for(image, scene), NOISE)
    u = np.array([np.log(0.1), 1.5])
    for plain, sloped in zip(problem.columns(u), problem.columns(u, derivatives=True), strict=True):
        np.testing.assert_allclose(sloped.table, plain.table, rtol=1e-9, atol=1e-12)
