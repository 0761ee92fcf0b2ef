"""Layers of the benchmark's spheres by known shape: the fit's own, colour's where those are preferred.

The spheres are drawn without the project's lobes, sample by sample, so lobe and truth share no code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.spheres import PHASE_DEG, RADIUS_PX, SIZE_PX, Picture
from toolkit.flags import SampleFlag
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.agreement import agreement
from toolkit.inference.compare import rank
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.layers import layers_of
from toolkit.inference.light_colour import light_colour
from toolkit.inference.model import Model
from toolkit.records import Agreement, Camera, Fit, LinearImage, Noise, Plane, Scene, Sphere
from toolkit.separation import Illuminant, separate

ALL = ("torrance-sparrow", "phong", "blinn-phong", "beckmann", "ggx")  # what a user gets who asks for none
WITHOUT_TAIL = ("torrance-sparrow", "beckmann")
ROUNDING = 1e-6  # sd, so that a clean picture has weights


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """The preferred layers (h, w, 3), the fit behind the shape's own, what colour said, the light the fit saw."""

    diffuse: np.ndarray
    specular: np.ndarray
    fit: Fit
    agreed: Agreement
    light: Illuminant | None


def scene() -> Scene:
    """The benchmark's sphere and lamp, exactly known; the light's strength and colour are not."""
    phase = np.radians(PHASE_DEG)
    light = DirectionalLight(direction=(0.8 * np.sin(phase), 0.6 * np.sin(phase), np.cos(phase)), direction_sd_deg=0.0)
    middle = (SIZE_PX - 1) / 2
    sphere = Sphere(centre_px=(middle, middle), radius_px=RADIUS_PX, covariance_px2=np.zeros((3, 3)), source="given")
    return Scene(camera=Camera(), sphere=sphere, lights=(light,), scale="relative")


def image_of(values: np.ndarray, usable: np.ndarray, sd: float, white: float) -> LinearImage:
    """An RGB picture (h, w, 3) as three planes, its unusable samples flagged as clipped."""
    planes = [
        Plane(
            channel=c,
            values=values[..., c].astype(np.float32),
            flags=np.where(usable[..., c], 0, int(SampleFlag.CLIPPED)).astype(np.uint8),
            origin_px=(0.0, 0.0),
            step_px=1,
        )
        for c in range(3)
    ]
    noise = Noise(gain=np.zeros(3), read=np.full(3, max(sd, ROUNDING)), source="given")
    height, width = values.shape[:2]
    return LinearImage(
        name="sphere", sha256="", width_px=width, height_px=height, planes=tuple(planes), noise=noise, white=white
    )


def by_shape(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray, models: Sequence[str] = ALL) -> Answer:
    """Every model fitted, the best one's layers; those by colour where the lobes fail and colour does not."""
    image, there = image_of(values, usable, sd, truth.clip), scene()
    cells = gather_for(image, there)
    fits = tuple(infer(image, there, cells, Model.named(m), seed=0, fixed=("all",), effective=1000) for m in models)
    best = fits[rank(fits)[0]]
    layers = layers_of(best, values, usable, origin_px=(0.0, 0.0), step_px=1)
    colours = separate(
        values, variance=image.noise, usable=usable, on_sphere=truth.on_sphere, light_colour=truth.light_colour
    )
    agreed = agreement(colours, layers, best)
    chosen = layers if agreed.preferred == "shape" else colours
    return Answer(diffuse=chosen.diffuse, specular=chosen.specular, fit=best, agreed=agreed, light=light_colour(best))
