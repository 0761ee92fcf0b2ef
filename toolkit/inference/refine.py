"""From a shape to the optimum: descents, with weights and tangents taken anew in turn until all of them stand.

Weights come from the model's own prediction, never from the noisy sample: noise in a weight is correlated with noise
in the datum and biases an albedo by tens of its sd.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance.fresnel import TANGENT_F0

from .descend import STANDS_SD, descend, misfit_root, shape_sd
from .normal import Weighing, weigh
from .problem import Evaluated, Optimum, Problem, f0_of, weights_at
from .weights import Weights

ROUNDS = 4  # of new weights, at most
TANGENT_STANDS = 0.003  # of F0, by which it may lie beside where its tangent is taken: an error of second order


def refine(
    problem: Problem,
    u: Floats,
    weights: Weighing,
    cols: Evaluated | None = None,
    *,
    lands_sd: float = STANDS_SD,
    alike_sd: float = STANDS_SD,
) -> Optimum:
    """Descend from a shape, with new weights from the prediction in turn, until both stand.

    `cols` are the columns there with their derivatives, where they are known already; `lands_sd` the sds by which
    the end of a short step may be off that is not looked at again, `alike_sd` those that new weights may make of it.
    """
    here = descend(problem, u, weights, cols, lands_sd=lands_sd)
    for _ in range(ROUNDS):
        new, problem = weights_at(problem, here.predicted), _tangent_at(here)
        known = here.columns if problem is here.problem else None
        if known and _could_move_sd(new, here) <= alike_sd:
            break
        weights = weigh(new, problem.extras)
        before, here = here, descend(problem, here.at if known else here.u, weights, known, lands_sd=lands_sd)
        moved = np.abs(here.u - before.u)
        if known and np.all(moved <= lands_sd * shape_sd(here.joint, problem.layout)):
            break
    return here


def _tangent_at(optimum: Optimum) -> Problem:
    """The problem with a dielectric's tangent taken at the F0 that was found; itself where that makes no difference."""
    problem, fresnel = optimum.problem, optimum.problem.fresnel
    if fresnel.choice == "schlick" or fresnel.kind not in ("known", "pair"):
        return problem
    f0 = float(np.clip(np.mean(f0_of(problem, optimum.x)), *TANGENT_F0))
    if abs(f0 - fresnel.f0) <= TANGENT_STANDS * fresnel.f0:
        return problem
    return replace(problem, fresnel=replace(fresnel, f0=f0))


def _could_move_sd(weights: tuple[Weights, ...], optimum: Optimum) -> float:
    """By how many sds new weights could move the optimum.

    By Cauchy and Schwarz weights changed by a share e move it by at most e sds of the noise's part of the residuals,
    and by e times the root of the chi-square that is not noise.
    """
    change = sum(new.change(old) for new, old in zip(weights, optimum.weights.weights, strict=True))
    counted, tempering = optimum.weights.counted, optimum.problem.tempering
    apart = float(np.sqrt(1.0 / tempering)) + misfit_root(optimum.chi2, counted, tempering)
    return float(np.sqrt(change / max(counted, 1))) * apart
