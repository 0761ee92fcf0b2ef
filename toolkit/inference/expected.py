"""A photograph before it is taken: the cells that it would have, with the values to be expected on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from toolkit.geometry.sphere import bounding_box
from toolkit.records import Floats, LinearImage, Noise, Plane, Scene

from .fisher import Truth, at_truth
from .infer import gather_for
from .model import Model
from .problem import pose_views
from .views import View

MOSAIC = ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2))  # row, column and channel of a quad's samples


def expected_view(
    model: Model,
    scene: Scene,
    noise: Noise,
    truth: Truth,
    *,
    width_px: int,
    height_px: int,
    mosaic: bool,
    white: float,
    exposed: Callable[[float], Scene],
) -> View:
    """The photograph of a known material, free of noise; samples clip at `white`.

    `exposed` gives the scene with its irradiance in image units, told the largest radiance in the units of `scene`.
    """
    image = _unlit(scene, noise, width_px, height_px, mosaic=mosaic)
    cells = gather_for(image, scene)
    seen = exposed(max(float(p.max(initial=0.0)) for p in _predicted(model, View.of(scene, cells, noise), truth)))
    view = View.of(seen, cells, noise)
    channels = [
        replace(data, value=np.minimum(values, white), censored=values[: data.cells] >= white)
        for data, values in zip(cells.channels, _predicted(model, view, truth), strict=True)
    ]
    return View.of(seen, replace(cells, channels=(channels[0], channels[1], channels[2])), noise)


def _predicted(model: Model, view: View, truth: Truth) -> tuple[Floats, ...]:
    problem = pose_views(model, [view])
    if "specular_f0" in truth:
        problem = replace(problem, fresnel=replace(problem.fresnel, f0=float(np.mean(truth["specular_f0"]))))
    there = at_truth(problem, truth)
    return problem.predict(problem.columns(there.u), there.x)


def _unlit(scene: Scene, noise: Noise, width_px: int, height_px: int, *, mosaic: bool) -> LinearImage:
    """The sphere's part of a photograph whose samples are all there and all 0."""
    x0, y0, x1, y1 = bounding_box(scene, width_px, height_px)
    step = 2 if mosaic else 1
    x0, y0 = x0 - x0 % step, y0 - y0 % step
    height, width = (y1 - y0) // step, (x1 - x0) // step
    places = MOSAIC if mosaic else tuple((0, 0, channel) for channel in range(3))
    planes = tuple(
        Plane(
            channel=channel,
            values=np.zeros((height, width), np.float32),
            flags=np.zeros((height, width), np.uint8),
            origin_px=(float(x0 + column), float(y0 + row)),
            step_px=step,
        )
        for row, column, channel in places
    )
    return LinearImage(
        name="plan", sha256="", width_px=width_px, height_px=height_px, planes=planes, noise=noise, white=np.inf
    )
