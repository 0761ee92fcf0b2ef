"""The fit's own layers add up to its model, and leave nothing but noise of a photograph of its own kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pipelines.drawing import layers_of_fit
from synthetic.scenes import direction
from tests.laws.space import shapes, variants
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.geometry.sphere import on_sphere
from toolkit.inference import layers as module
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.layers import layers_of, predict
from toolkit.inference.model import Model, mirror_normal
from toolkit.radiometry.quads import quads
from toolkit.records import Camera, Fit, Floats, ModelLayers, Scene, Sphere
from toolkit.reflectance import LOBES

from .ball import BODY, NOISE, photograph, radiance_of, scene_of


@pytest.mark.parametrize("mosaic", [False, True])
def test_the_residual_is_the_noise(mosaic: bool) -> None:
    """Diffuse + specular + pedestal = model; photograph - model has the noise's variance in every channel."""
    radiance, scene = radiance_of(300)
    image = photograph(radiance, seed=5, mosaic=mosaic)
    fit = infer(image, scene, gather_for(image, scene), Model.named("torrance-sparrow"), seed=1, effective=500)
    layers = layers_of_fit(image, quads(image), fit)
    assert layers.model == pytest.approx(layers.diffuse + layers.specular + layers.pedestal, nan_ok=True, rel=1e-5)
    assert layers.residual == pytest.approx(layers.photograph - layers.model, nan_ok=True)
    inner = layers.model[..., 0] > 0.1 * np.nanmax(layers.model[..., 0])
    for channel, averaged in enumerate((1, 2, 1) if mosaic else (1, 1, 1)):
        variance = NOISE.variance(layers.model[..., channel][inner], channel) / averaged
        ratio = np.median(layers.residual[..., channel][inner] ** 2 / variance) / 0.4549  # median of chi-square, 1 dof
        assert ratio == pytest.approx(1.0, abs=0.08)


@pytest.mark.parametrize("chunk", [200, module.CHUNK])
def test_layers_are_moved_to_their_channels_places_by_their_own_slope(
    monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    """To the edges of the picture, where it cuts the ball, however many lines are drawn at a time; the limb stays."""
    fit = fit_of("torrance-sparrow", "lambert", {"roughness_rad": 0.12}, {}, scene_of(120))
    cx, cy = fit.scene.sphere.centre_px
    x, y = cx - 20.0, cy - fit.scene.sphere.radius_px - 3.0  # the ball's middle, and its limb on one side
    places = np.array([[0.25, -0.5], [0.0, 0.0], [-0.25, 0.25]])
    still = drawn(fit, 73, 55, origin_px=(x - 1.0, y - 1.0))
    monkeypatch.setattr(module, "CHUNK", chunk)
    moved = drawn(fit, 71, 53, origin_px=(x, y), places_px=places)
    assert np.isnan(still.diffuse).any()
    assert np.isfinite(still.diffuse[-1]).all()
    for name in ("diffuse", "specular"):
        for c, (dx, dy) in enumerate(places):
            layer = getattr(still, name)[..., c]
            down, across = np.gradient(layer)
            expected = np.maximum(layer + dx * across + dy * down, 0.0)
            expected = np.where(np.isnan(expected) | np.isnan(down + across), layer, expected)[1:-1, 1:-1]
            assert getattr(moved, name)[..., c] == pytest.approx(expected, nan_ok=True, rel=1e-5, abs=1e-7)


def test_a_part_of_the_picture_is_drawn_as_in_the_whole() -> None:
    """To the last bit: nothing hangs on where a picture ends."""
    fit = fit_of("ggx", "wolff", {"alpha": 0.2, "diffuse_index": 1.5}, {}, scene_of(120))
    places = np.array([[-0.5, -0.5], [0.0, 0.0], [0.5, 0.5]])
    whole = drawn(fit, 60, 60, origin_px=(0.5, 0.5), step_px=2, places_px=places)
    part = drawn(fit, 22, 29, origin_px=(30.5, 20.5), step_px=2, places_px=places)
    for name in ("diffuse", "specular"):
        assert np.array_equal(getattr(part, name), getattr(whole, name)[10:32, 15:44], equal_nan=True)


@pytest.mark.parametrize("view", ["whole", "highlight", "perspective"])
@pytest.mark.parametrize("name", LOBES)
def test_pictures_are_within_a_hundred_thousandth_of_what_is_predicted(name: str, view: str) -> None:
    """Of the brightest, and a ten-thousandth of what is there, at the sharpest and the widest shape, in any light."""
    lobe = LOBES[name]
    radius, step = 1300.0, 1 if view == "highlight" else 30
    scene = replace(scene_in_three_lights(radius), camera=perspective(radius) if view == "perspective" else Camera())
    corner = np.full(2, -radius - 10.0)
    if view == "highlight":
        right, up, _ = mirror_normal(scene, scene.lights[0])
        corner = radius * np.array([right, -up]) - 45.0
    x, y = (origin + step * np.arange(90) for origin in corner)
    inside = on_sphere(scene.camera, scene.sphere, x[None, :], y[:, None])
    assert inside.sum() > 4000
    for variant, shape in product(variants(lobe), shapes(lobe, (0.0, 1.0))):
        numbers = dict(zip((p.name for p in lobe.parameters), shape, strict=True))
        if lobe.kind == "diffuse":
            fit = fit_of("blinn-phong", name, {"shininess": 50.0, **numbers}, {}, scene)
        else:
            fit = fit_of(name, "lambert", numbers, variant, scene)
        found = drawn(fit, 90, 90, origin_px=(float(x[0]), float(y[0])), step_px=step)
        told = predict(fit, *(v[inside] for v in np.meshgrid(x, y)))
        for picture, expected in ((found.diffuse, told.diffuse), (found.specular, told.specular)):
            assert np.array_equal(np.isfinite(picture[..., 0]), inside)
            error = np.abs(picture[inside] - expected)
            assert (error <= 1e-5 * expected.max() + 1e-4 * expected).all(), (variant, shape)


def scene_in_three_lights(radius_px: float) -> Scene:
    """A far one, a near one, and a sized one."""
    sphere = Sphere(centre_px=(0.0, 0.0), radius_px=radius_px, covariance_px2=np.eye(3), source="given")
    towards = tuple(2.0 * v for v in direction(50.0, -100.0))
    lights = (
        DirectionalLight(direction=direction(35.0, 20.0), irradiance=(3.0, 2.5, 2.0)),
        PointLight(position=(towards[0], towards[1], towards[2]), irradiance=(0.5, 0.5, 0.5)),
        DirectionalLight(direction=direction(75.0, 150.0), irradiance=(0.3, 0.4, 0.5), angular_radius_deg=5.0),
    )
    return Scene(camera=Camera(), sphere=sphere, lights=lights, scale="absolute")


def perspective(radius_px: float) -> Camera:
    """A camera so near that it sees the sphere under 22 degrees."""
    return Camera(projection="perspective", focal_length_px=5.0 * radius_px, principal_point_px=(100.0, -50.0))


def fit_of(model: str, diffuse: str, shape: Mapping[str, float], variant: Mapping[str, str], scene: Scene) -> Fit:
    """As if it had been fitted, with an F0 or an albedo a channel."""
    colours = {"diffuse_albedo": np.array(BODY), "pedestal": np.zeros(3)}
    if LOBES[model].fresnel:
        colours |= {"specular_strength": np.ones(3), "specular_f0": np.array([0.04, 0.05, 0.06])}
    else:
        colours |= {"specular_albedo": np.full(3, 0.1)}
    return Fit(
        model=model,
        variant=LOBES[model].complete(variant),
        diffuse=diffuse,
        status="converged",
        flags=(),
        shape=shape,
        colours=colours,
        chi2_reduced=1.0,
        elpd=0.0,
        elpd_blocks=np.zeros(1),
        parameters=(),
        diagnostics=None,
        draws={},
        scene=scene,
    )


def drawn(
    fit: Fit,
    height: int,
    width: int,
    *,
    origin_px: tuple[float, float],
    step_px: int = 1,
    places_px: Floats | None = None,
) -> ModelLayers:
    """Its layers over a dark picture."""
    dark, used = np.zeros((height, width, 3), np.float32), np.ones((height, width, 3), bool)
    return layers_of(fit, dark, used, origin_px=origin_px, step_px=step_px, places_px=places_px)
