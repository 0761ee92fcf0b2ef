"""A stated irradiance's error: one representation for one photograph and for several, as every other calibration's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from synthetic.scenes import as_measured
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.inference.infer import gather_for, infer_views
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.views import View
from toolkit.records import Fit, Floats, Light, Scene

from .ball import NOISE, photograph, radiance_of, replace_light

SIZE_PX, SD = 120, 0.05
MODEL = Model.named("torrance-sparrow")


def stated(scene: Scene, sd: float | None = SD) -> Scene:
    """The scene with its first light's irradiance known to `sd`."""
    return replace_light(scene, irradiance_relative_sd=sd)


def relative_sd(fit: Fit) -> Floats:
    """Of the body's albedo."""
    albedo = next(e for e in fit.parameters if e.name == "diffuse_albedo")
    return np.asarray(albedo.sd) / np.asarray(albedo.estimate)


def fitted(*scenes: Scene, fixed: tuple[str, ...] = ()) -> Fit:
    """Photographs of one ball, each told its own scene."""
    radiance, _ = radiance_of(SIZE_PX)
    images = [photograph(radiance, seed=i) for i in range(len(scenes))]
    views = [View.of(told, gather_for(image, told), NOISE) for image, told in zip(images, scenes, strict=True)]
    return infer_views(views, MODEL, seed=1, fixed=fixed, effective=1000)


def test_one_photographs_albedo_is_as_well_known_as_its_irradiance() -> None:
    """And two that err each by itself know it to 5 % over root two; the shape does not hang on it."""
    _, scene = radiance_of(SIZE_PX)
    exact, one, two = fitted(scene), fitted(stated(scene)), fitted(stated(scene), stated(scene))
    assert relative_sd(one) == pytest.approx(np.full(3, SD), rel=0.1)
    assert relative_sd(two) == pytest.approx(np.full(3, SD / np.sqrt(2.0)), rel=0.1)
    assert max(relative_sd(exact)) < 0.1 * SD
    roughness, told = (next(e for e in fit.parameters if e.name == "roughness_rad") for fit in (one, exact))
    assert float(roughness.sd) == pytest.approx(float(told.sd), rel=0.2)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("fixed", ["irradiance", "all"])
def test_what_is_fixed_is_exactly_known(count: int, fixed: str) -> None:
    """Of one photograph and of several alike."""
    _, scene = radiance_of(SIZE_PX)
    assert max(relative_sd(fitted(*[stated(scene)] * count, fixed=(fixed,)))) < 0.1 * SD


def test_a_cards_error_stays_whole_beside_an_irradiance_known_worse() -> None:
    """The second photograph, known to half, takes nothing from the card's 5 %."""
    _, scene = radiance_of(SIZE_PX)
    card = replace(scene, irradiance_covariance=SD**2 * np.eye(3))
    assert relative_sd(fitted(card, stated(scene, 0.5))) == pytest.approx(np.full(3, SD), rel=0.1)


def test_each_lamp_has_an_error_of_its_own() -> None:
    """Free is that of the lamp that states it, not that of the one beside it."""
    _, scene = radiance_of(SIZE_PX)
    aside = replace_light(scene, direction=(-0.6, 0.3, 0.55**0.5))
    both = replace(scene, lights=scene.lights + aside.lights)
    assert {n for n in shifts_of(stated(both)).names if "scale" in n} == {
        f"light0.scale_{colour}" for colour in ("red", "green", "blue")
    }


@pytest.mark.parametrize("light", [DirectionalLight, PointLight])
def test_an_error_of_no_irradiance_is_refused(light: type[Light]) -> None:
    """A grey card tells the irradiance with its own error; a light's stands beside a light's irradiance alone."""
    where = {"direction": (0.0, 0.0, 1.0)} if light is DirectionalLight else {"position": (0.0, 0.0, 9.0)}
    with pytest.raises(ValidationError, match="give irradiance as well"):
        light(**where, irradiance_relative_sd=SD)  # type: ignore[call-arg]  # every kind takes it
    with pytest.raises(ValidationError):
        light(**where, irradiance=(1.0, 1.0, 1.0), irradiance_relative_sd=1.5)  # type: ignore[call-arg]


def test_a_measured_irradiance_is_off_by_its_error() -> None:
    """What a simulated user was told: each channel by itself, by as much as is stated."""
    _, scene = radiance_of(SIZE_PX)
    rng = np.random.default_rng(0)
    told = np.array([as_measured(stated(scene), rng).lights[0].irradiance for _ in range(2000)])
    off = np.log(told / np.array(scene.lights[0].irradiance))
    np.testing.assert_allclose(np.cov(off.T), SD**2 * np.eye(3), atol=0.1 * SD**2)
