"""The surface in blocks: what each says of the unknowns, and by how much they disagree beyond the noise.

Neighbouring samples share whatever a model gets wrong; blocks far enough apart do not. A block is a sector of a ring
about the first light's highlight.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    """Per block the information (B, P, P) and the score (B, P) of all unknowns, and its own log density (B,)."""

    information: Floats
    score: Floats
    density: Floats

    def centred(self) -> Floats:
        """Scores (b, P) of the blocks that hold samples, about their mean; their products sum to the scores' spread."""
        used = self.score[np.any(self.score != 0.0, axis=1)]
        return np.asarray((used - used.mean(axis=0)) * np.sqrt(len(used) / max(len(used) - 1, 1)))


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
    problem = optimum.problem
    cols = problem.columns(optimum.u, derivatives=True)
    predicted = problem.predict(cols, optimum.x)
    size, count = len(optimum.joint), COUNT * len(blocks)
    information, score, density = np.zeros((count, size, size)), np.zeros((count, size)), np.zeros(count)
    for c, (data, w) in enumerate(zip(problem.channels, optimum.weights.weights, strict=True)):
        mine = optimum.x[problem.layout.index[c]]
        slopes = [m @ mine + o for m, o in zip(cols[c].d_matrix, cols[c].d_offset, strict=True)]
        jacobian = np.column_stack([cols[c].matrix, problem.extras[c], *slopes])
        index = np.concatenate([problem.layout.index[c], np.arange(len(problem.layout.names), size)])
        residual = data.value - predicted[c]
        misfit = w.times(residual)
        weighted, counted = w.times(jacobian.T), np.flatnonzero(w.each)
        photograph = c // 3
        mine_in = blocks[photograph][data.rows[counted]]
        order = counted[np.argsort(mine_in, kind="stable")]
        edges = np.searchsorted(np.sort(mine_in), np.arange(COUNT + 1))
        for b in range(COUNT):
            rows, there = order[edges[b] : edges[b + 1]], COUNT * photograph + b
            information[there][np.ix_(index, index)] += weighted[:, rows] @ jacobian[rows]
            score[there][index] += weighted[:, rows] @ residual[rows]
            density[there] += 0.5 * np.sum(np.log(w.each[rows] / (2 * np.pi))) - 0.5 * misfit[rows] @ residual[rows]
    return Blocks(information=information, score=score, density=density)
