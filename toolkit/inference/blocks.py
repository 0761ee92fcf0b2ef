"""The surface in blocks: what each says of the unknowns, and by how much they disagree beyond the noise.

Neighbouring samples share whatever a model gets wrong; blocks far enough apart do not. A block is a sector of a ring
about the first light's highlight.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import surface
from toolkit.records import Floats, Scene

from .cells import Cells
from .problem import Optimum

RINGS_RAD = (0.08, 0.2, 0.5, 1.0)  # inner edges of the rings about the first light's half vector
SECTORS = 8
COUNT = (len(RINGS_RAD) + 1) * SECTORS


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blocks:
    """Per block, of one photograph after the other, what it says: its score (B, P) of all unknowns, its own log density
    (B,), and its information of those unknowns `own` (p,) that its photograph depends on, (COUNT, p, p) a photograph.
    """

    own: tuple[NDArray[np.intp], ...]
    information: tuple[Floats, ...]
    score: Floats
    density: Floats


def blocks_of(scene: Scene, cells: Cells) -> NDArray[np.intp]:
    """The block of every cell (N,)."""
    seen = surface(scene.camera, scene.sphere, cells.x_px, cells.y_px)
    towards, _ = scene.lights[0].at(seen.normal)
    half = towards + seen.view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    theta = np.arccos(np.clip(np.einsum("ni,ni->n", seen.normal, half), -1.0, 1.0))
    centre = half.mean(axis=0)
    across = np.cross(centre, [0.0, 1.0, 0.0] if abs(centre[1]) < 0.9 else [1.0, 0.0, 0.0])
    along = np.cross(centre, across)
    azimuth = np.arctan2(seen.normal @ along, seen.normal @ across)
    sector = np.floor((azimuth / (2 * np.pi) + 0.5) * SECTORS).astype(np.intp) % SECTORS
    return np.asarray(np.digitize(theta, RINGS_RAD) * SECTORS + sector, np.intp)


def by_block(optimum: Optimum, *blocks: NDArray[np.intp]) -> Blocks:
    """What each block adds to the normal equations at an optimum.

    `blocks`, one a photograph, (N,) is the block of every cell; those of several photographs follow each other.
    """
    count = COUNT * len(blocks)
    own = tuple(optimum.own(v) for v in range(len(blocks)))
    information = tuple(np.zeros((COUNT, len(mine), len(mine))) for mine in own)
    score, density = np.zeros((count, len(optimum.joint))), np.zeros(count)
    for c, (data, w) in enumerate(zip(optimum.problem.channels, optimum.weights.weights, strict=True)):
        photograph, counted = c // 3, np.flatnonzero(w.each)
        there = blocks[photograph][data.rows[counted]].astype(np.int16)  # which numpy sorts by their digits
        sorting = np.argsort(there, kind="stable")
        order, edges = counted[sorting], np.searchsorted(there[sorting], np.arange(COUNT + 1))
        index, slopes = optimum.slopes(c)
        place = np.searchsorted(own[photograph], index)
        rows = w.apart(np.concatenate([slopes, data.value[None] - optimum.predicted[c]])).take(order, axis=1)
        weighted = rows * w.each[order]
        sums = np.array([weighted[:, a:b] @ rows[:, a:b].T for a, b in pairwise(edges)])  # the last: of what is left
        mine = slice(COUNT * photograph, COUNT * (photograph + 1))
        information[photograph][:, place[:, None], place] += sums[:, :-1, :-1]
        score[mine, index] += sums[:, :-1, -1]
        logs = np.bincount(there, np.log(w.each[counted] / (2 * np.pi)), COUNT)
        density[mine] += 0.5 * (logs - sums[:, -1, -1])
    return Blocks(own=own, information=information, score=score, density=density)


def scores_of(optimum: Optimum, *blocks: NDArray[np.intp]) -> Floats:
    """The blocks' scores alone (B, P), as `by_block` has them."""
    found = np.zeros((len(optimum.joint), COUNT * len(blocks)))
    for c, (data, w) in enumerate(zip(optimum.problem.channels, optimum.weights.weights, strict=True)):
        index, slopes = optimum.slopes(c)
        there = blocks[c // 3][data.rows[: data.cells]] + COUNT * (c // 3)
        slopes *= w.times(data.value - optimum.predicted[c])
        pulls = slopes.reshape(len(index), 3 if data.slopes else 1, data.cells).sum(axis=1)
        for i, pull in zip(index, pulls, strict=True):
            found[i] += np.bincount(there, pull, minlength=found.shape[1])
    return found.T


def centred(scores: Floats) -> Floats:
    """Scores (b, P) of the blocks that hold samples, about their mean; their products sum to the scores' spread."""
    used = scores[np.any(scores != 0.0, axis=1)]
    return np.asarray((used - used.mean(axis=0)) * np.sqrt(len(used) / max(len(used) - 1, 1)))
