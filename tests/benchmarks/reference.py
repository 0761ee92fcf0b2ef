"""The reference problem for speed: Lambert and a Beckmann lobe on some 187,000 pixels of three channels, seven numbers.

A 512 x 512 orthographic sphere under one light 30 degrees off the axis, with shot and read noise. The rivals see the
pixels that our cells hold, no others. Either they do the same job as ours, from the pixels to the optimum: geometry, a
neutral start, and weights by iteration, one over the variance at the radiance of the model. Or they are given all that
for nothing: the geometry, the converged model's weights, a start near the truth. What is timed of ours always begins at
the pixels: statistics, search and weights included, three pedestals more.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from synthetic.materials import material
from synthetic.render import render
from synthetic.scenes import direction
from tests.inference.ball import photograph
from tests.inference.every import covered
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.cells import SIDE_X, SIDE_Y, Cells
from toolkit.inference.fit import fit
from toolkit.inference.gather import gather
from toolkit.inference.lit import Lit, lit_by
from toolkit.inference.model import Model
from toolkit.inference.problem import Optimum, Problem, pose
from toolkit.inference.solving import inverse
from toolkit.records import Camera, Floats, LinearImage, Noise, Scene, Sphere
from toolkit.reflectance import LOBES

ALPHA, STRENGTH = 0.2, 0.04
BODY = np.array([0.45, 0.25, 0.12])
NOISE = Noise(gain=np.full(3, 4e-4), read=np.full(3, 2e-3), source="given")
TRUTH = np.array([*BODY, *np.full(3, STRENGTH), np.log(ALPHA)])
NEUTRAL = np.array([*np.full(6, 0.2), np.log(0.3)])
START = TRUTH * np.array([0.7, 0.8, 1.2, 1.5, 1.5, 1.5, 0.8])
IRRADIANCE = 3.0


def scene_of(size_px: int = 512) -> Scene:
    """The scene, at any size of the image."""
    light = DirectionalLight(direction=direction(30.0), irradiance=(IRRADIANCE,) * 3, direction_sd_deg=0.3)
    sphere = Sphere(
        centre_px=((size_px - 1) / 2,) * 2, radius_px=size_px / 2, covariance_px2=np.eye(3) * 0.01, source="given"
    )
    return Scene(camera=Camera(), sphere=sphere, lights=(light,), scale="absolute")


def photograph_of(size_px: int = 512, *, seed: int = 0, noise: Noise = NOISE, alpha: float = ALPHA) -> LinearImage:
    """The photograph, at any size; `noise` is what it really has, whatever the fit is told."""
    glossy = material("beckmann", {"alpha": alpha, "diffuse_albedo": BODY.tolist(), "specular_f0": STRENGTH})
    picture = render(scene_of(size_px), glossy, width_px=size_px, height_px=size_px)
    return replace(photograph(picture.radiance(), seed=seed, noise=noise, mosaic=False), noise=NOISE)


def ours(image: LinearImage, scene: Scene) -> Optimum:
    """From pixels to optimum."""
    return fit(pose(Model.named("beckmann"), scene, gather(image, scene), NOISE))


def seven(image: LinearImage, scene: Scene) -> Optimum:
    """The same with the pedestals held at 0, as the rivals have it: for comparing the optima."""
    problem = pose(Model.named("beckmann"), scene, gather(image, scene), NOISE)
    return fit(without_pedestal(problem))


def without_pedestal(problem: Problem) -> Problem:
    """The problem with its pedestals held at 0."""
    precision = problem.prior.precision.copy()
    for i, (name, _) in enumerate(problem.layout.names):
        if name == "pedestal":
            precision[i, i] *= 1e8
    return replace(problem, prior=replace(problem.prior, precision=precision))


def numbers(optimum: Optimum) -> Floats:
    """An optimum's seven numbers in the rivals' order."""
    layout = optimum.problem.layout
    return np.concatenate([layout.of("diffuse_albedo", optimum.x), layout.of("specular_f0", optimum.x), optimum.u])


def sds_of(optimum: Optimum) -> Floats:
    """Sds of the seven numbers, in the rivals' order."""
    sd = np.sqrt(np.diag(inverse(optimum.joint)))
    layout = optimum.problem.layout
    return np.concatenate([layout.of("diffuse_albedo", sd), layout.of("specular_f0", sd), sd[layout.size :]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pixels:
    """What the rivals work on: geometry (N,), or (4, N) over the pixels' squares, radiance and weights (3, N)."""

    lit: Lit
    values: Floats
    weights: Floats

    def model(self, p: Floats) -> Floats:
        """Radiance (3, N) of seven numbers: three albedos, three F0, log alpha."""
        gloss = LOBES["beckmann"].value(self.lit.cosines, (float(np.exp(p[6])),))
        f = [f0 * (1 - self.lit.schlick) + self.lit.schlick for f0 in p[3:6]]
        body = LOBES["lambert"].value(self.lit.cosines, ())
        return np.stack([self._over_pixels(IRRADIANCE * (p[c] * body + f[c] * gloss)) for c in range(3)])

    def _over_pixels(self, values: Floats) -> Floats:
        return values if values.ndim == 1 else np.asarray(values.mean(axis=0))

    def weighed(self, signal: Floats) -> Pixels:
        """The same with weights for a radiance (3, N)."""
        return replace(self, weights=1.0 / np.stack([NOISE.variance(signal[c], c) for c in range(3)]))

    def residuals(self) -> Callable[[Floats], Floats]:
        """Of the seven numbers, weighted, flat."""
        root = np.sqrt(self.weights)
        return lambda p: ((self.model(np.asarray(p)) - self.values) * root).ravel()


def pixels(image: LinearImage, scene: Scene, cells: Cells, *, square: bool = False) -> Pixels:
    """Every pixel that the cells hold, at its centre or over its square, weighed by its own noisy value."""
    row, column = np.nonzero(covered(cells, image.planes[0].values.shape))
    x, y = column.astype(float), row.astype(float)
    reach = 12**-0.5 if square else 0.0
    lit = lit_by(scene, x + SIDE_X * reach, y + SIDE_Y * reach)[0] if square else lit_by(scene, x, y)[0]
    values = np.stack([plane.values[row, column] for plane in image.planes]).astype(float)
    return Pixels(lit=lit, values=values, weights=np.ones_like(values)).weighed(np.maximum(values, 0.0))


def given(image: LinearImage, scene: Scene, optimum: Optimum, *, square: bool = False) -> Pixels:
    """The same, weighed by the converged model."""
    found = pixels(image, scene, optimum.problem.views[0].cells, square=square)
    return found.weighed(found.model(numbers(optimum)))


def seconds(action: Callable[[], object], repeats: int = 5) -> float:
    """The best of several runs."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        action()
        taken.append(time.perf_counter() - begin)
    return min(taken)
