"""Fit and posterior of the reference problem beside the usual ways, as ratios of one run.

python -m tests.benchmarks.inference     prints the figures; `make bench` calls `main()`

Times are processor seconds of one core, so that other work on the machine does not count.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from toolkit.inference.fit import fit
from toolkit.inference.gather import gather
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.posterior import sample
from toolkit.inference.problem import Optimum
from toolkit.inference.settle import fit_with_shifts
from toolkit.inference.solving import inverse, solve
from toolkit.records import Floats, LinearImage, Scene

from . import adam, rivals
from .reference import given, numbers, ours, photograph_of, scene_of, sds_of, seven
from .rivals import lmfit_leastsq, same_job, scipy_trf

EFFECTIVE = 5000
GRID = 400  # places of the quadrature
SIZES_PX = (512, 1024, 2048)
Row = dict[str, Any]


def seconds(action: Callable[[], object], repeats: int = 1) -> float:
    """Processor seconds, the best of several runs."""
    taken = []
    for _ in range(repeats):
        begin = time.process_time()
        action()
        taken.append(time.process_time() - begin)
    return min(taken)


def fitting(image: LinearImage, scene: Scene, optimum: Optimum) -> Iterator[Row]:
    """The fit, statistics included, beside scipy's, lmfit's and Mitsuba's over all pixels; how far apart optima lie."""
    cells = optimum.problem.views[0].cells
    data, each, theirs = given(image, scene, optimum), list[float](), list[float]()
    for _ in range(3):  # in turn: some milliseconds of ours all lie in one slow moment of a machine, seconds do not
        each.append(seconds(lambda: ours(image, scene), repeats=30))
        theirs.append(seconds(lambda: same_job(scipy_trf, image, scene, cells)))
    fitted = min(each)
    yield row("fit, x scipy TRF 2-point", min(theirs) / fitted, 150.0)
    told = "given the weights and a start near the truth"
    yield row(f"fit, x scipy TRF 2-point {told}", seconds(lambda: scipy_trf(data), repeats=3) / fitted)
    if there("lmfit"):
        yield row(
            "fit, x lmfit", seconds(lambda: same_job(lmfit_leastsq, image, scene, cells), repeats=3) / fitted, 40.0
        )
        yield row(f"fit, x lmfit {told}", seconds(lambda: lmfit_leastsq(data), repeats=3) / fitted)
    if adam.works():
        taken, steps, apart = adam.seconds_to(image, scene, optimum)
        yield row(f"fit, x Mitsuba with Adam, {steps} steps to {apart:.2g} sd", taken / fitted, 1000.0)
    free = seconds(lambda: fit_with_shifts(optimum.problem, shifts_of(scene)), repeats=3)
    alone = seconds(lambda: fit(optimum.problem), repeats=5)
    yield row("free calibration, x the fit without", free / alone, 10.0, most=True)


def exactness() -> Iterator[Row]:
    """How far from the optimum over every single sample, found by scipy, each sample a mean over its square."""
    for roughness_rad in (0.02, 0.1, 0.2, 0.3):
        image, scene = photograph_of(alpha=roughness_rad * 2**0.5), scene_of()
        held = seven(image, scene)
        found = scipy_trf(given(image, scene, held, square=True), numbers(held))
        apart = float(np.max(np.abs(numbers(held) - found) / sds_of(held)))
        yield row(f"fit, farthest from every sample's at roughness {roughness_rad:g} rad, sd", apart, 0.03, most=True)


def sampling(image: LinearImage, scene: Scene, optimum: Optimum) -> Iterator[Row]:
    """The posterior, statistics and fit included, beside emcee's and NUTS' over all pixels, and against quadrature."""

    def whole() -> object:
        return sample(ours(image, scene), seed=1, effective=EFFECTIVE, draws=EFFECTIVE)

    draws = sample(optimum, seed=1, effective=EFFECTIVE, draws=EFFECTIVE)
    effective = min(draws.diagnostics.ess_min, float(len(draws.x)))
    per_s = effective / seconds(whole, repeats=3)
    data, at = given(image, scene, optimum), numbers(optimum)
    plain = rivals.emcee_effective_per_s(data, at, lambda run: seconds(run, repeats=5))
    yield row("posterior, effective samples a second, x emcee over all pixels", per_s / plain, 1000.0)
    if there("numpyro"):
        nuts = rivals.nuts_effective_per_s(data, at, seconds)
        yield row("posterior, effective samples a second, x NumPyro NUTS", per_s / nuts, 3000.0)
    mean, sd = quadrature(optimum)
    drawn = np.hstack([draws.x, draws.u])
    off, wide = np.abs(drawn.mean(axis=0) - mean) / sd, np.abs(drawn.std(axis=0, ddof=1) / sd - 1.0)
    yield row("posterior, effective samples", effective, float(EFFECTIVE) * 0.999)
    yield row("posterior, largest error of a mean by quadrature, sd", float(off.max()), 0.05, most=True)
    yield row("posterior, largest error of an sd by quadrature", float(wide.max()), 0.03, most=True)


def quadrature(optimum: Optimum) -> tuple[Floats, Floats]:
    """Mean and sd of all linear unknowns and of the one shape number, summed over a fine grid of the latter."""
    problem, width = optimum.problem, float(np.sqrt(inverse(optimum.joint)[-1, -1]))
    grid = optimum.u[0] + width * np.linspace(-7.0, 7.0, GRID)
    density, means, variances = np.empty(GRID), [], []
    for i, u in enumerate(grid):
        normal = problem.assemble(problem.columns(np.array([u])), optimum.weights)
        mean = solve(normal.matrix, normal.rhs)
        density[i] = -0.5 * (normal.squares - mean @ normal.rhs) - 0.5 * np.linalg.slogdet(normal.matrix)[1]
        means.append(np.append(mean, u))
        variances.append(np.append(np.diag(inverse(normal.matrix)), 0.0))
    weight = np.exp(density - density.max())
    weight /= weight.sum()
    mean = weight @ np.array(means)
    return mean, np.sqrt(weight @ (np.array(variances) + (np.array(means) - mean) ** 2))


def growth() -> Iterator[Row]:
    """Time against the number of samples, in passes of numpy.sum over the same data; the posterior's time."""
    fitted, summed, sampled = [], [], []
    for size_px in SIZES_PX:
        image, scene = photograph_of(size_px), scene_of(size_px)
        optimum = ours(image, scene)
        fitted.append(seconds(lambda i=image, s=scene: ours(i, s), repeats=5))
        summed.append(seconds(lambda i=image: [np.sum(plane.values) for plane in i.planes], repeats=9))
        sampled.append(seconds(lambda o=optimum: sample(o, seed=1, effective=EFFECTIVE), repeats=3))
        gathering = seconds(lambda i=image, s=scene: gather(i, s), repeats=3)
        sys.stdout.write(f"{size_px} px: fit {fitted[-1] * 1e3:.1f} ms, of it gathering {gathering * 1e3:.1f} ms\n")
    passes = (fitted[-1] - fitted[0]) / (summed[-1] - summed[0])
    yield row("growth, passes of numpy.sum over the samples added", passes, 12.0, most=True)
    yield row("posterior at sixteen times the samples, x its time", sampled[-1] / sampled[0], 1.3, most=True)


def there(package: str) -> bool:
    """Whether a peer of the bench group is installed; its row is left out where not, and that is said."""
    found = importlib.util.find_spec(package) is not None
    if not found:
        sys.stdout.write(f"{package} is not installed: its rows are left out\n")
    return found


def row(name: str, figure: float, target: float | None = None, *, most: bool = False) -> Row:
    """One line of the table; `most` where the target is the most that is allowed; no target where none is set."""
    met = target is None or (figure <= target if most else figure >= target)
    return {"name": name, "figure": figure, "target": target, "met": met}


def main() -> list[Row]:
    """Print the table; rows of name, figure, target, met."""
    from threadpoolctl import threadpool_limits

    image, scene = photograph_of(), scene_of()
    rows = []
    with threadpool_limits(1):
        optimum = ours(image, scene)
        for part in (fitting(image, scene, optimum), sampling(image, scene, optimum), exactness(), growth()):
            for one in part:
                rows.append(one)
                asked = "" if one["target"] is None else f"  asked {one['target']:g}  {one['met']}"
                sys.stdout.write(f"{one['name']:66} {one['figure']:10.3g}{asked}\n")
                sys.stdout.flush()
    return rows


if __name__ == "__main__":
    main()
