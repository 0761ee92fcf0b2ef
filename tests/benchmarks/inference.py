"""The reference problem for speed: Lambert and a Beckmann lobe on 188,000 pixels of three channels, seven numbers.

A 512 x 512 orthographic sphere under one light 30 degrees off the axis, with shot and read noise. Rivals see the same
pixels and start near the truth; what is timed of ours begins at the pixels, search and statistics included.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from synthetic.materials import material
from synthetic.render import render
from synthetic.scenes import direction
from tests.inference.ball import photograph
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.cells import MIN_N_DOT_L, MIN_N_DOT_V, gather
from toolkit.inference.fit import Optimum, fit, pose
from toolkit.inference.model import Model, lit_by
from toolkit.inference.normal import inverse
from toolkit.inference.nuisances import fit_with_shifts, shifts_of
from toolkit.inference.posterior import sample
from toolkit.records import Camera, Floats, LinearImage, Noise, Scene, Sphere
from toolkit.reflectance import LOBES

SIZE_PX, ALPHA = 512, 0.2
BODY = np.array([0.45, 0.25, 0.12])
NOISE = Noise(gain=np.full(3, 4e-4), read=np.full(3, 2e-3), source="given")
REPEATS = 5


def problem() -> tuple[LinearImage, Scene]:
    """The photograph and its scene."""
    light = DirectionalLight(direction=direction(30.0), irradiance=(3.0, 3.0, 3.0))
    sphere = Sphere(
        centre_px=((SIZE_PX - 1) / 2,) * 2, radius_px=SIZE_PX / 2, covariance_px2=np.eye(3) * 0.01, source="given"
    )
    scene = Scene(camera=Camera(), sphere=sphere, lights=(light,), scale="absolute")
    glossy = material("beckmann", {"alpha": ALPHA, "diffuse_albedo": BODY.tolist(), "specular_f0": 0.04})
    picture = render(scene, glossy, width_px=SIZE_PX, height_px=SIZE_PX)
    return photograph(picture.radiance(), seed=0, noise=NOISE, mosaic=False), scene


def pixels(image: LinearImage, scene: Scene) -> tuple[Any, Floats, Floats]:
    """Geometry, radiance (3, N) and weights (3, N) of every usable pixel, for the rivals."""
    y, x = np.mgrid[:SIZE_PX, :SIZE_PX].reshape(2, -1).astype(float)
    lit = lit_by(scene, x, y)[0]
    use = (lit.cosines.n_dot_v > MIN_N_DOT_V) & (lit.cosines.n_dot_l > MIN_N_DOT_L)
    lit = lit_by(scene, x[use], y[use])[0]
    values = np.stack([p.values.ravel()[use] for p in image.planes]).astype(float)
    smooth = np.maximum(values, 0.0)
    return lit, values, 1.0 / np.stack([NOISE.variance(s, c) for c, s in enumerate(smooth)])


def residuals(lit: Any, values: Floats, weights: Floats) -> Callable[[Floats], Floats]:
    """The rivals' weighted residuals of seven numbers: three albedos, three F0, log alpha."""
    root, lambert = np.sqrt(weights), LOBES["lambert"].value(lit.cosines, ())

    def of(p: Floats) -> Floats:
        gloss = LOBES["beckmann"].value(lit.cosines, (float(np.exp(p[6])),))
        f = p[3:6, None] * (1 - lit.schlick) + lit.schlick
        return np.asarray(((3.0 * (p[:3, None] * lambert + f * gloss) - values) * root).ravel())

    return of


def ours(image: LinearImage, scene: Scene) -> Optimum:
    """From pixels to optimum, search and statistics included."""
    return fit(pose(Model.named("beckmann"), scene, gather(image, scene), NOISE))


def seconds(action: Callable[[], object], repeats: int = REPEATS) -> float:
    """The best of several runs."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        action()
        taken.append(time.perf_counter() - begin)
    return min(taken)


def plain_effective_per_s(of: Callable[[Floats], Floats], start: Floats, sd: Floats) -> float:
    """Effective samples a second of emcee over all pixels: 20 walkers, a short run, at emcee's usual 80 steps each."""
    import emcee

    sampler = emcee.EnsembleSampler(20, 7, lambda p: -0.5 * float(np.sum(of(p) ** 2)))
    begin = time.perf_counter()
    sampler.run_mcmc(start + sd * np.random.default_rng(0).standard_normal((20, 7)), 3)
    return 20 * 3 / (time.perf_counter() - begin) / 80.0  # 80 steps: the autocorrelation time of 7 dimensions


def main() -> list[dict[str, Any]]:
    """Print the table; rows of name, figure, target, met."""
    image, scene = problem()
    optimum = ours(image, scene)
    lit, values, weights = pixels(image, scene)
    of, truth = residuals(lit, values, weights), np.array([*BODY, 0.04, 0.04, 0.04, np.log(ALPHA)])
    start = truth * np.array([0.7, 0.8, 1.2, 1.5, 1.5, 1.5, 0.8])
    fitting = seconds(lambda: ours(image, scene))
    plain = seconds(lambda: least_squares(of, start), repeats=1)
    found = least_squares(of, start).x
    sd = np.sqrt(np.diag(inverse(optimum.joint)))[-1]
    free = seconds(lambda: fit_with_shifts(optimum.problem, shifts_of(scene)))
    alone = seconds(lambda: fit(optimum.problem))
    draws = sample(optimum, seed=1, effective=5000, draws=5000)
    sampling = fitting + seconds(lambda: sample(optimum, seed=1, effective=5000, draws=5000), repeats=3)
    theirs = plain_effective_per_s(of, found, np.full(7, 1e-4))
    rows = [
        _row("fit, x scipy TRF 2-point", plain / fitting, 150.0),
        _row(
            "posterior, effective samples a second, x emcee over all pixels",
            draws.diagnostics.ess_min / sampling / theirs,
            1000.0,
        ),
        _row("free calibration, x the fit without", free / alone, 10.0, most=True),
    ]
    sys.stdout.write(
        f"{len(values[0])} pixels x 3: ours {fitting * 1e3:.0f} ms, scipy {plain:.2f} s; "
        f"log alpha apart by {abs(found[6] - optimum.u[0]) / sd:.3f} sd (weights differ); "
        f"{draws.diagnostics.ess_min / sampling:.0f} effective samples/s against {theirs:.1f}\n"
    )
    for row in rows:
        sys.stdout.write(f"{row['name']:70} {row['figure']:10.1f}  asked {row['target']:g}  {row['met']}\n")
    return rows


def _row(name: str, figure: float, target: float, *, most: bool = False) -> dict[str, Any]:
    return {"name": name, "figure": figure, "target": target, "met": figure <= target if most else figure >= target}


if __name__ == "__main__":
    main()
