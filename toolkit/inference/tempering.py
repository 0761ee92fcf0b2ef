"""A model that is not exactly right must not be fitted as if it were: the data weigh less by what it gets wrong.

With a misfit of 3 % and noise of 0.1 % everything that could take up a little of the misfit is bent to do so, far
beyond what is known of it: the sphere by twenty sds of its outline, the light, the black level. So the data's weight is
divided by how much further the blocks of the surface pull the answer apart than noise would (tempered, as likelihoods
of dependent data are: Pauli, Racugno & Ventura 2011). Priors and calibrations then keep their say, and where the noise
explains what is left, nothing changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks, by_block, centred, scores_of
from .descend import misfit_root
from .problem import Optimum
from .solving import inverse

STANDS = 1.04  # a factor by which the tempering may still change


def tempering_of(optimum: Optimum, blocks: Sequence[NDArray[np.intp]]) -> float:
    """How many times less than by their noise the data should weigh: at least 1, and that without `blocks`.

    Those, one a photograph, (N,) are the block of every cell. Were the noise all, the blocks' scores would spread by
    their information: tr(C S) = tr(C I) with the posterior's covariance C.
    """
    if not blocks:
        return 1.0
    tempering = optimum.problem.tempering
    if tempering == 1.0 and misfit_root(optimum.chi2, optimum.weights.counted, 1.0) == 0.0:
        return 1.0
    covariance, scores = inverse(optimum.joint), centred(scores_of(optimum, *blocks))
    spread = float(np.sum((scores @ covariance) * scores))
    known = float(np.sum(covariance * optimum.problem.known_precision))
    return max(tempering * spread / (len(covariance) - known), 1.0)


def stands(tempering: float, before: float, within: float = STANDS) -> bool:
    """Whether a tempering is as good as the one before it."""
    return bool(max(tempering, before) <= within * min(tempering, before))


def next_tempering(tempering: float, found: float, last: float) -> tuple[float, float]:
    """The next one to try where this one led to another, and the step to it in the logarithm, as `last` was.

    Where clipped cells change sides the tempering jumps, and two of them can lead to each other for ever: a step that
    turns back goes half the way.
    """
    step = float(np.log(found / tempering))
    if step * last < 0.0:
        step = float(np.copysign(0.5 * min(abs(step), abs(last)), step))
    return tempering * float(np.exp(step)), step


def by_noise_alone(optimum: Optimum, *where: NDArray[np.intp]) -> tuple[Optimum, Blocks]:
    """The same place with the data's full weight: what the noise alone would make of the fit; and what its blocks say.

    `where`, one a photograph, (N,) is the block of every cell. All blocks together are all of the data.
    """
    problem, weights = optimum.problem, optimum.weights.scaled(optimum.problem.tempering)
    problem, chi2 = replace(problem, tempering=1.0), chi2_tempered(optimum, 1.0)
    blocks = by_block(replace(optimum, problem=problem, weights=weights), *where)
    joint = problem.known_precision
    for own, information in zip(blocks.own, blocks.information, strict=True):
        joint[own[:, None], own] += information.sum(axis=0)
    return replace(optimum, problem=problem, weights=weights, joint=joint, chi2=chi2), blocks


def chi2_tempered(optimum: Optimum, tempering: float) -> float:
    """Chi-square of an optimum, the prior's part among it, had its data this weight."""
    prior = optimum.problem.prior
    towards = optimum.x - prior.centre
    known = float(towards @ prior.precision @ towards)
    return known + (optimum.chi2 - known) * optimum.problem.tempering / tempering
