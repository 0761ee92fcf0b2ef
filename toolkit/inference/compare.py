"""Which model predicts better: expected log predictive density by leaving out one block of the surface at a time.

Neighbouring samples share whatever a model gets wrong, so single samples left out would flatter it. Around the
optimum the model is linear, so what the fit would have been without a block follows from that block's own normal
equations, with no new fit.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Fit, Floats

from .blocks import COUNT, Blocks
from .problem import Optimum
from .solving import inverse, inverse_each, marginal

DECIDED_SD = 2.0  # a model is preferred where its lead exceeds its own sd this many times
EQUAL_SD = 1.0  # up to a lead of so many of its sds the simpler model is as good (Breiman et al. 1984)
LEAST_LEAD = 4.0  # nats: a smaller lead decides nothing, its own sd is not to be relied on (Sivula et al. 2020)


def elpd_blocks(optimum: Optimum, blocks: Blocks) -> Floats:
    """Log predictive density of each block's cell means given all other blocks (B,)."""
    covariance, found = inverse(optimum.joint), []
    for v, (own, informations) in enumerate(zip(blocks.own, blocks.information, strict=True)):
        mine = slice(COUNT * v, COUNT * (v + 1))
        joint, of_all = marginal(optimum.joint, own), covariance[own[:, None], own]
        found.append(_without(joint, of_all, informations, blocks.score[mine, own], blocks.density[mine]))
    return np.concatenate(found)


def _without(joint: Floats, of_all: Floats, informations: Floats, scores: Floats, plain: Floats) -> Floats:
    """Predictive densities of blocks (B,), each from a posterior that never saw it, by Woodbury's identity."""
    found, held = np.zeros(len(plain)), informations.any(axis=(1, 2))
    information, score = informations[held], scores[held]
    covariance = inverse_each(joint - information + 1e-12 * np.diag(np.diag(joint)))
    shift = -np.vecdot(covariance, score[:, None])
    moved = score - np.vecdot(information, shift[:, None])
    quadratic = -np.vecdot(score + moved, shift) - np.vecdot(moved @ of_all, moved)
    _, spread = np.linalg.slogdet(np.eye(len(joint)) + covariance @ information)
    found[held] = plain[held] - 0.5 * (quadratic + spread)
    return found


def bic_of(optimum: Optimum, blocks: Blocks) -> float:
    """Schwarz's criterion (1978): -2 log likelihood + unknowns x log of the data that count.

    Beside the predictive density, not instead of it: it takes all data for independent and every model for one that
    could be exactly right.
    """
    return float(len(optimum.joint) * np.log(max(optimum.weights.counted, 1)) - 2.0 * blocks.density.sum())


def difference(a: Fit, b: Fit) -> tuple[float, float]:
    """Difference of expected log predictive density of two fits, first less second, and its sd over the blocks."""
    each = np.asarray(a.elpd_blocks) - np.asarray(b.elpd_blocks)
    used = each[(np.asarray(a.elpd_blocks) != 0) | (np.asarray(b.elpd_blocks) != 0)]
    return float(each.sum()), float(np.sqrt(len(used)) * used.std(ddof=1)) if len(used) > 1 else float("inf")


def extends(fit: Fit, other: Fit) -> bool:
    """Whether a fit is another one over a body of more numbers: no rival of it."""
    return fit.model == other.model and len(fit.shape) > len(other.shape)


def rank(fits: tuple[Fit, ...]) -> tuple[int, int | None, tuple[float, float] | None]:
    """The best fit, the preferred one (None where the data do not decide), and the best one's lead with its sd.

    Of the fits that predict as well as the best prediction, to the sd of its lead, the one with the fewest shape
    numbers is the best: what an extra number does not earn it does not get. It is preferred where all others that are
    not decidedly worse only extend it by another diffuse lobe.
    """
    order = sorted(range(len(fits)), key=lambda i: -fits[i].elpd)
    leads = {i: difference(fits[order[0]], fits[i]) for i in order}

    def within(sds: float) -> list[int]:
        return [i for i, (lead, sd) in leads.items() if i == order[0] or lead <= max(sds * sd, LEAST_LEAD)]

    best = min(within(EQUAL_SD), key=lambda i: (len(fits[i].shape), -fits[i].elpd))
    rivals = within(DECIDED_SD)
    extensions = all(extends(fits[i], fits[best]) for i in rivals if i != best)
    others = [i for i in order if i not in rivals] or [i for i in order if i != best]
    return best, best if extensions else None, difference(fits[best], fits[others[0]]) if others else None
