"""The fit's own layers add up to its model, and leave nothing but noise of a photograph of its own kind."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.drawing import layers_of_fit
from toolkit.inference import layers as module
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.layers import layers_of
from toolkit.inference.model import Model
from toolkit.radiometry.quads import quads

from .ball import NOISE, photograph, radiance_of


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
    """To the edges of the picture, where it cuts the ball, however many lines are moved at a time; the limb stays."""
    radiance, scene = radiance_of(120)
    image = photograph(radiance, seed=5)
    fit = infer(image, scene, gather_for(image, scene), Model.named("torrance-sparrow"), seed=1, effective=300)
    cx, cy = fit.scene.sphere.centre_px
    cut, used = np.zeros((71, 53, 3), np.float32), np.ones((71, 53, 3), bool)  # its middle, and its limb on one side
    where = {"origin_px": (cx - 20.0, cy - fit.scene.sphere.radius_px - 3.0), "step_px": 1}
    places = np.array([[0.25, -0.5], [0.0, 0.0], [-0.25, 0.25]])
    still = layers_of(fit, cut, used, **where)
    monkeypatch.setattr(module, "CHUNK", chunk)
    moved = layers_of(fit, cut, used, **where, places_px=places)
    assert np.isnan(still.diffuse).any()
    assert np.isfinite(still.diffuse[-1]).all()
    for name in ("diffuse", "specular"):
        for c, (dx, dy) in enumerate(places):
            layer = getattr(still, name)[..., c]
            down, across = np.gradient(layer)
            expected = np.maximum(layer + dx * across + dy * down, 0.0)
            expected = np.where(np.isnan(expected), layer, expected)
            assert getattr(moved, name)[..., c] == pytest.approx(expected, nan_ok=True, rel=1e-5, abs=1e-7)
