"""How well a limb places centre and radius: the samples' errors, and what the limb's own misfit adds.

The misfit moves the limb in and out along its azimuth, a Gaussian process of an unknown size and reach; besides, errors
may be larger in all samples alike, as where texture correlates them. Size, reach and that factor are averaged over what
the stretches' pulls say of them (the pulls' marginal likelihood, centre and radius and the like integrated out), so
that the misfit goes to nothing where pulls are no larger than noise lets expect, and a slow one, which centre and
radius take up unseen, is as large as the waves that they cannot take up let expect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

RADIUS = 2  # the number that moves the whole limb outwards
# of Student's t with 5 degrees of freedom and Gaussian errors, in units of the mean weight (Huber 1964):
CURVATURE = 0.7777  # mean derivative of the score by the sample
SPREAD = 0.6668  # mean square of the score
FACTORS = np.array([1.0, 1.15, 1.4, 1.7, 2.2, 3.0, 4.5])  # on the samples' sd
SIZES = np.concatenate([[0.0], 0.008 * 2.0 ** np.arange(8)])  # sd of the misfit, samples
NONE = 0.9  # chance of no misfit beforehand; else each size is as likely
ACCURACY = 0.001  # samples: errors in renders without noise
REACHES = np.array([0.05, 0.13, 0.33])  # of the misfit's correlation, in turns
SEEN = 1e-3  # of the best stretch's information, from which a stretch is asked


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pulls:
    """What each stretch says of the numbers at the solution: scores, and their derivatives at fixed weights."""

    scores: Floats  # (stretches, numbers)
    bends: Floats  # (stretches, numbers, numbers)
    precision: Floats  # (numbers,), of the priors
    loose: NDArray[np.bool_]  # (numbers,), those that no bound holds
    unexplained_px: float  # what most stretches share and the model leaves beside the limb, as a shift of it
    step_px: float

    def __post_init__(self) -> None:
        readonly(self)


def covariance(pulls: Pulls) -> Floats:
    """Covariance (3, 3) of centre x, y and radius, px^2."""
    keep = np.flatnonzero(pulls.loose)
    bends = CURVATURE * pulls.bends[:, keep][:, :, keep]
    prior = np.diag(pulls.precision[keep])
    inverse = np.linalg.inv(bends.sum(axis=0) + prior)
    noise = SPREAD / CURVATURE * bends.sum(axis=0)
    factor2, misfits = _learnt(pulls.scores[:, keep], bends, prior, pulls.step_px)
    outwards = bends[:, :, RADIUS]
    misfit = outwards.T @ misfits @ outwards
    found = inverse @ (factor2 * noise + prior + misfit) @ inverse
    common2 = pulls.unexplained_px**2 + (ACCURACY * pulls.step_px) ** 2
    return np.asarray(found[:3, :3] + common2 * np.eye(3))


def _learnt(scores: Floats, bends: Floats, prior: Floats, step_px: float) -> tuple[float, Floats]:
    """Means of the factor's square and of the misfit's covariance over the stretches (px^2), given the pulls."""
    count = len(scores)
    information = bends[:, RADIUS, RADIUS]
    seen = information > SEEN * information.max()
    root = np.sqrt(SPREAD / CURVATURE / information[seen])  # sd of the stretch's offset, px
    offsets = scores[seen, RADIUS] / information[seen] / root
    design = bends[seen, RADIUS] / (information[seen] * root)[:, None]
    size2 = (SIZES * step_px) ** 2
    turns = np.arange(count) / count
    apart = np.abs(turns[:, None] - turns)
    shapes = [np.exp(-np.minimum(apart, 1.0 - apart) / reach) for reach in REACHES]
    told = np.stack(
        [_log_likelihood(s[np.ix_(seen, seen)] / np.outer(root, root), size2, offsets, design, prior) for s in shapes]
    )
    chance = np.where(SIZES > 0, (1.0 - NONE) / np.count_nonzero(SIZES), NONE)
    weight = np.exp(told - told.max()) * (FACTORS**-2.0)[:, None] * chance
    weight /= weight.sum()
    misfits = np.einsum("rfs,s,rij->ij", weight, size2, np.stack(shapes))
    return float(np.einsum("rfs,f->", weight, FACTORS**2)), misfits


def _log_likelihood(shape: Floats, size2: Floats, offsets: Floats, design: Floats, prior: Floats) -> Floats:
    """Of each factor and size (FACTORS, SIZES), up to a constant; everything in sds of the offsets."""
    values, vectors = np.linalg.eigh(shape)
    turned, columns = vectors.T @ offsets, vectors.T @ design
    variance = FACTORS[:, None, None] ** 2 + size2[:, None] * np.maximum(values, 0.0)  # (factors, sizes, stretches)
    weighted = columns / variance[..., None]
    normal = np.swapaxes(weighted, -1, -2) @ columns + prior
    right = np.einsum("fsik,i->fsk", weighted, turned)
    explained = np.einsum("fsk,fsk->fs", right, np.linalg.solve(normal, right[..., None])[..., 0])
    left = np.sum(turned**2 / variance, axis=-1) - explained
    return np.asarray(-0.5 * (np.sum(np.log(variance), axis=-1) + np.linalg.slogdet(normal)[1] + left))
