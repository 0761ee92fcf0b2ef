"""The fit's own layers add up to its model, and leave nothing but noise of a photograph of its own kind."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.colours import layers_of_fit
from toolkit.inference.infer import gather_for, infer
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
