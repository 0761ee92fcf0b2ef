"""Which model predicts better: expected log predictive density by leaving out one block of the surface at a time.

Neighbouring samples share whatever a model gets wrong, so single samples left out would flatter it; a block is a
sector of a ring about the highlight. Around the optimum the model is linear, so what the fit would have been without
a block follows from that block's own normal equations, with no new fit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import surface
from toolkit.records import Fit, Floats, Scene

from .cells import Cells
from .fit import Optimum
from .normal import inverse

RINGS_RAD = (0.08, 0.2, 0.5, 1.0)  # inner edges of the rings about the first light's half vector
SECTORS = 8
DECIDED_SD = 2.0  # a model is preferred where its lead exceeds its own sd this many times


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


def elpd_blocks(optimum: Optimum, blocks: NDArray[np.intp]) -> Floats:
    """Log predictive density of each block's cell means given all other blocks ((len(RINGS_RAD) + 1) * SECTORS,)."""
    problem = optimum.problem
    cols = problem.columns(optimum.u, derivatives=True)
    predicted = problem.predict(cols, optimum.x)
    count = (len(RINGS_RAD) + 1) * SECTORS
    size = len(optimum.joint)
    information, score, plain = np.zeros((count, size, size)), np.zeros((count, size)), np.zeros(count)
    for c, (data, w) in enumerate(zip(problem.cells.channels, optimum.weights, strict=True)):
        mine = optimum.x[problem.layout.index[c]]
        slopes = [m @ mine + o for m, o in zip(cols[c].d_matrix, cols[c].d_offset, strict=True)]
        jacobian = np.hstack([cols[c].matrix, problem.extras[c], *(s[:, None] for s in slopes)])
        index = np.concatenate([problem.layout.index[c], np.arange(len(problem.layout.names), size)])
        residual = data.value - predicted[c]
        order = np.argsort(blocks[data.rows], kind="stable")
        edges = np.searchsorted(blocks[data.rows][order], np.arange(count + 1))
        for b in range(count):
            rows = order[edges[b] : edges[b + 1]]
            weighted = jacobian[rows] * w[rows, None]
            information[b][np.ix_(index, index)] += weighted.T @ jacobian[rows]
            score[b][index] += weighted.T @ residual[rows]
            plain[b] += 0.5 * np.sum(np.log(w[rows] / (2 * np.pi))) - 0.5 * w[rows] @ residual[rows] ** 2
    return np.array([_without(optimum.joint, h, g, p) for h, g, p in zip(information, score, plain, strict=True)])


def _without(joint: Floats, information: Floats, score: Floats, plain: float) -> float:
    """Predictive density of a block from a posterior that never saw it, by Woodbury's identity."""
    if not information.any():
        return 0.0
    covariance = inverse(joint - information + 1e-12 * np.diag(np.diag(joint)))
    shift = -covariance @ score
    moved = score - information @ shift
    quadratic = -2 * float(shift @ score) + float(shift @ information @ shift)
    quadratic -= float(moved @ inverse(joint) @ moved)
    _, spread = np.linalg.slogdet(np.eye(len(joint)) + covariance @ information)
    return plain - 0.5 * quadratic - 0.5 * float(spread)


def difference(a: Fit, b: Fit) -> tuple[float, float]:
    """Difference of expected log predictive density of two fits, first less second, and its sd over the blocks."""
    each = np.asarray(a.elpd_blocks) - np.asarray(b.elpd_blocks)
    used = each[(np.asarray(a.elpd_blocks) != 0) | (np.asarray(b.elpd_blocks) != 0)]
    return float(each.sum()), float(np.sqrt(len(used)) * used.std(ddof=1)) if len(used) > 1 else float("inf")


def rank(fits: tuple[Fit, ...]) -> tuple[int, int | None, tuple[float, float] | None]:
    """The best fit, the preferred one (None where the data do not decide), and the best one's lead with its sd."""
    order = sorted(range(len(fits)), key=lambda i: -fits[i].elpd)
    if len(fits) == 1:
        return 0, 0, None
    lead = difference(fits[order[0]], fits[order[1]])
    return order[0], order[0] if lead[0] > DECIDED_SD * lead[1] else None, lead
