"""The body colour in illuminant-orthogonal coordinates: first the plane, then the matte line within it.

Across the light's colour no highlight is seen: there the cluster is a line through the origin whatever the
highlight does (Mallick et al. 2005, "Beyond Lambert", use the same coordinates), and its direction is found from
every block. Along the light's colour the matte line is the lower edge (`matte.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .matte import lower_edge
from .samples import Blocks

TUKEY = 4.685  # biweight: 95 % efficient on Gaussian noise
FAINTEST = 0.15  # of the brightest blocks: fainter ones say nothing of the edge
SHADOW = 0.03  # of the brightest blocks: the body is dark there
FEWEST = 20  # blocks that a veil or a bend is judged by
DIM, BRIGHT = (0.3, 0.5), (0.75, 1.1)  # parts of the matte line, of the brightest blocks
BEND = 0.05  # of the angle between body and light; linear pictures stay below, encoded ones reach 0.07 to 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """`colour` (3,) unit norm with covariance (3, 3); `misfit` is the rms distance of the blocks from the plane
    of body and light over what the noise allows; `off_plane` the same distance in radiance.
    `veil` is what lies over everything along the light's colour, radiance; `bent` tells of a matte line that is none.
    `seen` is False where no colour other than the light's stands out from the noise: `colour` is then the light's.
    """

    colour: Floats
    covariance: Floats
    misfit: float
    off_plane: float
    veil: float = 0.0
    bent: bool = False
    seen: bool = False

    def __post_init__(self) -> None:
        readonly(self)


def body_colour(cloud: Blocks, light: Floats) -> Body:
    """Fit the body colour of a one-coloured object under a light of unit colour `light` (3,)."""
    across = _basis(light)
    q = cloud.colour @ across.T
    noise = np.einsum("ic,nc,jc->nij", across, cloud.variance, across)
    scatter = (q.T @ q - noise.sum(axis=0)) / len(q)
    values, axes = np.linalg.eigh(scatter)
    typical = float(np.trace(noise.mean(axis=0)) / 2)
    faintest = typical * 6 * math.sqrt(2 / len(q))
    towards = axes[:, 1] * (np.sign(axes[:, 1] @ q.sum(axis=0)) or 1.0)
    if values[1] > faintest:
        towards, turn_variance, scale, off = _refine(q, noise, towards)
        u = towards @ across
        if np.quantile(cloud.colour @ u, 0.98) > 0:
            return _along(cloud, light, u, turn_variance, scale, off)
    along = max(float(np.sqrt(np.mean((cloud.colour @ light) ** 2))), 1e-300)
    sd = min(math.sqrt(max(values[1], faintest)) / along, 1.0)
    return Body(colour=light, covariance=sd**2 / 2 * across.T @ across, misfit=1.0, off_plane=math.sqrt(typical))


def _basis(light: Floats) -> Floats:
    """Two unit vectors (2, 3) across the light's colour."""
    first = np.cross(light, np.eye(3)[int(np.argmin(np.abs(light)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(light, first)])


def _refine(q: Floats, noise: Floats, towards: Floats) -> tuple[Floats, float, float, float]:
    """Robust total least squares for the direction (2,): with its variance, the misfit's scale and its rms."""
    for _ in range(4):
        side = np.array([-towards[1], towards[0]])
        off, m = q @ side, q @ towards
        variance = np.einsum("i,nij,j->n", side, noise, side)
        shared = np.einsum("i,nij,j->n", side, noise, towards)
        z = off / np.sqrt(variance)
        scale = max(1.4826 * float(np.median(np.abs(z))), 1e-6)
        robust = np.maximum(1 - (z / (TUKEY * max(scale, 1.0))) ** 2, 0.0) ** 2
        weight = robust / variance
        information = float(weight @ np.maximum(m * m - np.einsum("i,nij,j->n", towards, noise, towards), 0.0))
        turn = float(weight @ (off * m - shared)) / max(information, 1e-300)
        towards = towards + np.clip(turn, -0.3, 0.3) * side
        towards = towards / np.linalg.norm(towards)
    rms = float(np.sqrt(np.mean(off**2)))
    return towards, max(scale, 1.0) ** 2 / max(information, 1e-300), scale, rms


def _along(cloud: Blocks, light: Floats, u: Floats, turn_variance: float, scale: float, off: float) -> Body:
    """The matte line within the plane, and both errors as a covariance of the unit colour."""
    t, m = cloud.colour @ light, cloud.colour @ u
    variance = cloud.variance * scale**2
    top = float(np.quantile(m, 0.98))
    veil = _veil(t, m / top, variance @ light**2)
    use = m > FAINTEST * top
    t, m, variance = t[use] - veil, m[use], variance[use]
    noise = variance @ light**2, variance @ u**2, variance @ (light * u)
    edge = lower_edge(t, m, *noise)
    colour = u + edge.slope * light
    length = float(np.linalg.norm(colour))
    colour = colour / length
    side = np.cross(light, u)
    tilt = (light - (light @ colour) * colour) / length  # how the unit colour moves with the slope
    covariance = turn_variance / length**2 * np.outer(side, side) + edge.sd**2 * np.outer(tilt, tilt)
    ratio_sd = float(np.sqrt(np.median(noise[0] + edge.slope**2 * noise[1]))) / max(scale, 1e-6) / (DIM[0] * top)
    return Body(
        colour=colour,
        covariance=covariance,
        misfit=scale,
        off_plane=off,
        veil=veil,
        bent=_bent(t / m, m / top, ratio_sd),
        seen=True,
    )


def _veil(t: Floats, brightness: Floats, variance: Floats) -> float:
    """Light of the light's own colour that lies over everything, seen where the body is in shadow; 0 if none is."""
    shadow = np.abs(brightness) < SHADOW
    if np.count_nonzero(shadow) < FEWEST:
        return 0.0
    level = float(np.quantile(t[shadow], 0.05))  # the least: a veil may grow towards the limb
    return level if level > 5 * float(np.sqrt(np.median(variance[shadow]))) else 0.0


def _bent(ratio: Floats, brightness: Floats, ratio_sd: float) -> bool:
    """Whether the cluster's lower edge points elsewhere among dim blocks than among bright ones.

    A linear picture has one matte line. One that is not linear has a bent one, and so has a highlight so broad that
    it leaves no bright pixel matte: either way the body colour is not what it seems.
    """
    edges = []
    for low, high in (DIM, BRIGHT):
        held = ratio[(brightness > low) & (brightness < high)]
        if len(held) < FEWEST:
            return False
        edges.append(math.atan2(1.0, float(np.quantile(held, 0.02))))
    dim, bright = edges
    return abs(dim - bright) > BEND * bright + 2 * ratio_sd * math.sin(bright) ** 2
