"""The reference problem by Mitsuba 3 with Adam: a differentiable render of the ball, compared with the photograph.

The weights and a start near the truth are given. It stops where its seven numbers are all as near to the optimum as
asked, or at the last step allowed; how near they came is told.
"""

from __future__ import annotations

import importlib.util
import os
import time
from typing import Any

import numpy as np

from tests.inference.every import covered
from tests.validation.mitsuba_render import llvm
from toolkit.inference.problem import Optimum
from toolkit.records import Floats, LinearImage, Scene

from .reference import IRRADIANCE, START, given, numbers, sds_of

SHARE = 0.5  # of the blend that is the mirroring metal
RATE = 0.01  # Adam's step
STEPS = 400  # at most
NEAR_SD = 1.0
SAMPLES = 4  # a pixel
BODY, GLOSS = "ball.bsdf.bsdf_0.reflectance.value", "ball.bsdf.bsdf_1.specular_reflectance.value"
ALPHA = "ball.bsdf.bsdf_1.alpha.value"


def works() -> bool:
    """Whether Mitsuba and its LLVM are here."""
    return importlib.util.find_spec("mitsuba") is not None and llvm() is not None


def seconds_to(image: LinearImage, scene: Scene, optimum: Optimum) -> tuple[float, int, float]:
    """Processor seconds, steps, and the largest distance from the optimum in sds then; compilation counted."""
    os.environ["DRJIT_LIBLLVM_PATH"] = str(llvm())
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    size, data = image.planes[0].values.shape, given(image, scene, optimum)
    held = covered(optimum.problem.views[0].cells, size)
    target, weights = (np.zeros((*size, 3), np.float32) for _ in range(2))
    target[held], weights[held] = data.values.T, data.weights.T
    begin, step, apart = time.process_time(), 0, np.inf
    seen, wanted, weigh = mi.load_dict(_ball(mi, scene, size)), mi.TensorXf(target), mi.TensorXf(weights)
    parameters = mi.traverse(seen)
    adam = mi.ad.Adam(lr=RATE, params={key: parameters[key] for key in (BODY, GLOSS, ALPHA)})
    while step < STEPS and apart > NEAR_SD:
        parameters.update(adam)
        picture = mi.render(seen, parameters, seed=step)
        dr.backward(dr.mean(dr.square(picture - wanted) * weigh))
        adam.step()
        for key in (BODY, GLOSS, ALPHA):
            adam[key] = dr.clip(adam[key], 1e-3, 2.0)
        apart = float(np.max(np.abs(_numbers(adam) - numbers(optimum)) / sds_of(optimum)))
        step += 1
    return time.process_time() - begin, step, apart


def _numbers(adam: Any) -> Floats:
    body, gloss, alpha = (np.array(adam[key], float).ravel() for key in (BODY, GLOSS, ALPHA))
    return np.concatenate([(1.0 - SHARE) * body, SHARE * gloss, np.log(alpha)])


def _ball(mi: Any, scene: Scene, size: tuple[int, int]) -> dict[str, Any]:
    metal = {"type": "roughconductor", "material": "none", "distribution": "beckmann", "alpha": float(np.exp(START[6]))}
    blend = {
        "type": "blendbsdf",
        "weight": SHARE,
        "body": {"type": "diffuse", "reflectance": _rgb(START[:3] / (1.0 - SHARE))},
        "gloss": metal | {"specular_reflectance": _rgb(START[3:6] / SHARE)},
    }
    film = {"width": size[1], "height": size[0], "pixel_format": "rgb", "component_format": "float32"}
    return {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
        "sensor": {
            "type": "orthographic",
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 10], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "rfilter": {"type": "box"}, **film},
            "sampler": {"type": "multijitter", "sample_count": SAMPLES},
        },
        "light": {
            "type": "directional",
            "direction": [-float(v) for v in scene.lights[0].direction],
            "irradiance": _rgb(np.full(3, IRRADIANCE)),
        },
        "ball": {"type": "sphere", "center": [0, 0, 0], "radius": 1.0, "bsdf": blend},
    }


def _rgb(values: Floats) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in values]}
