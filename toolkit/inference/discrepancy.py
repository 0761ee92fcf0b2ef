"""Intervals that hold on photographs: the model is never exactly right, and the noise alone knows nothing of it.

What a model gets wrong is shared by neighbouring samples, so it shows in how far the blocks of the surface pull the
answer apart. Where they do so beyond what the noise explains, the posterior is stretched to the covariance that the
blocks' own scores have (the sandwich: Huber 1967, White 1982; applied to draws: Shaby 2014). Where they do not, as on
a perfect render, nothing changes. What the data weigh on the whole is settled before: see `tempering`.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .posterior import Draws
from .problem import Optimum
from .solving import inverse


def stretch_of(optimum: Optimum, scores: Floats) -> Floats:
    """The matrix (P, P) that takes deviations of all unknowns from their mean to those the blocks' centred scores
    (b, P), of the optimum's own weights, warrant.

    In the coordinates in which the posterior is a unit ball, the blocks' scores have a covariance whose eigenvalues
    are 1 but for the misfit. Chance lifts the largest of them to (1 + sqrt(P / B))^2 (Marchenko & Pastur 1967); only
    what exceeds that counts.
    """
    covariance = inverse(optimum.joint)
    root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
    scores = scores @ root
    spread, directions = np.linalg.eigh(scores.T @ scores)
    chance = (1.0 + np.sqrt(len(root) / max(len(scores), 1))) ** 2
    factor = np.sqrt(np.where(spread > chance, spread, 1.0))
    whitened = (directions * factor) @ directions.T
    return np.asarray(root @ whitened @ np.linalg.inv(root))


def stretched(optimum: Optimum, draws: Draws, stretch: Floats) -> Draws:
    """The draws with their deviations from their mean stretched; what leaves a parameter's range is put on its end.

    From their mean, not from the mode: where these lie apart, stretching would carry the mean away with it.
    """
    problem, together = optimum.problem, np.hstack([draws.x, draws.u])
    mean = together.mean(axis=0)
    moved = mean + (together - mean) @ stretch.T
    size = problem.layout.size
    return Draws(
        u=np.clip(moved[:, size:], *problem.model.bounds()),
        x=np.clip(moved[:, :size], problem.prior.low, problem.prior.high),
        diagnostics=draws.diagnostics,
        long_enough=draws.long_enough,
        truncation=draws.truncation,
    )
