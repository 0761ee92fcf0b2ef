"""The matte line: the body colour, from the lower edge of a one-coloured object's cluster.

Klinker, Shafer & Kanade (1990) draw the matte line through the lower edge of the skewed T. Here x is split into
its part along the light's colour, t = x.L, and across it, m = x.u. A highlight only ever adds to t, so
t = slope m + s + noise with s >= 0, and most pixels have s near 0. Neither the minimum of t / m (it takes the
noise of one pixel for the edge) nor least squares (it takes the highlight's tail for body) finds the edge.

The distribution of s in units of the noise is taken as unimodal at 0: a point mass and half-uniforms of growing
width, with weights by expectation-maximisation (Stephens 2017, "False discovery rates: a new deal",
Biostatistics 18, eq. 2.4). The slope solves the score equation of that mixture f: sum psi(z) m / sd = 0, psi = -f'/f
(Tweedie's formula: psi is the noise that z is expected to hold), which for m with noise of its own is unbiased once
its share is taken off. psi falls to 0 in the highlight: the fit is one-sided by itself. Coarse noise first, the
real one last, so that clean and noisy pictures take the same path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats

LOW, HIGH, STEP = -8.0, 24.0, 0.125  # the window of z = (t - slope m) / sd that the mixture describes
WIDTHS = (0.75, 1.5, 3.0, 6.0, 12.0, 24.0)  # of the half-uniforms, in sd
STRAY = 0.002  # weight of what belongs to no component: dust, a foreign pixel
FIRST_NOISE = 0.02  # of the largest m: the noise that the first and coarsest level pretends
FINER = 0.25  # from level to level


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edge:
    """The lower edge t = slope m. `sd` holds the statistics and what the coarser levels say of the tail's pull."""

    slope: float
    sd: float
    matte_share: float  # of the samples, those that lie on the line within the noise


def _bins() -> tuple[Floats, Floats, Floats]:
    """Centres (bins,), densities (components, bins) and their derivatives in z."""
    z = np.arange(LOW + STEP / 2, HIGH, STEP)
    phi = np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)
    density, slope = [phi], [-z * phi]
    for width in WIDTHS:
        density.append((_below(z) - _below(z - width)) / width)
        slope.append((phi - np.exp(-0.5 * (z - width) ** 2) / math.sqrt(2 * math.pi)) / width)
    return z, np.array(density), np.array(slope)


def _below(z: Floats) -> Floats:
    """Normal distribution function; math.erf spares the import of scipy."""
    return np.array([0.5 * math.erfc(-v / math.sqrt(2)) for v in z])


CENTRES, DENSITY, SLOPE = _bins()


def weights(counts: Floats, start: Floats, rounds: int = 8) -> Floats:
    """Weights (components,) of the mixture by expectation-maximisation from counts (bins,)."""
    share = start
    stray = STRAY / (HIGH - LOW)
    total = max(float(counts.sum()), 1.0)
    for _ in range(rounds):
        joint = share[:, None] * DENSITY
        share = joint @ (counts / (joint.sum(axis=0) + stray)) / total
    return np.asarray(share)


def score(share: Floats) -> Floats:
    """Psi = -f'/f on the bins: the noise that each z is expected to hold, in sd."""
    f = share @ DENSITY + STRAY / (HIGH - LOW)
    return np.asarray(-(share @ SLOPE) / f)


def lower_edge(t: Floats, m: Floats, var_t: Floats, var_m: Floats, cov: Floats) -> Edge:
    """Fit t = slope m + s, s >= 0, to samples (N,), m > 0, with their noise (N,) each, all in the same units."""
    noise = (var_t, var_m, cov)
    top = float(np.quantile(m, 0.98))
    bright = m > 0.3 * top
    found = _Level(slope=float(np.quantile(t[bright] / m[bright], 0.1)), share=FLAT, information=0.0)
    floor = float(np.sqrt(np.median(_variance(found.slope, noise))))
    before = found
    for pretend in _levels(FIRST_NOISE * top, floor):
        sd = np.sqrt(_variance(found.slope, noise) + pretend**2)
        ceiling = float(np.quantile((t[bright] + 3 * sd[bright]) / m[bright], STRAY))
        start = _Level(slope=min(found.slope, ceiling), share=found.share, information=0.0)
        finer = _settle(start, t, m, noise, pretend)
        if finer is None:
            break
        before, found = found, finer
    pull = 0.5 * (before.slope - found.slope)  # the tail's pull falls by about 3 from level to level
    return Edge(
        slope=found.slope,
        sd=math.sqrt(1.0 / max(found.information, 1e-300) + pull**2),
        matte_share=float(found.share[0]),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Level:
    """The line at one level of noise, the mixture's weights, and the slope's information."""

    slope: float
    share: Floats
    information: float


FLAT = np.full(len(DENSITY), 1.0 / len(DENSITY))


def _variance(slope: float, noise: tuple[Floats, Floats, Floats]) -> Floats:
    var_t, var_m, cov = noise
    return np.asarray(var_t + slope**2 * var_m - 2 * slope * cov)


def _levels(first: float, floor: float) -> list[float]:
    """Falling pretended noise, ending with none."""
    count = max(math.ceil(math.log(max(0.5 * floor, 1e-12 * first) / first) / math.log(FINER)), 0)
    return [first * FINER**k for k in range(count)] + [0.0]


def _settle(
    level: _Level, t: Floats, m: Floats, noise: tuple[Floats, Floats, Floats], pretend: float, rounds: int = 8
) -> _Level | None:
    """Fisher scoring at one level; None where hardly a sample lies on the line: there is nothing finer to see."""
    slope, share, information = level.slope, np.maximum(level.share, 1e-4), 0.0
    for _ in range(rounds):
        variance = _variance(slope, noise) + pretend**2
        sd = np.sqrt(variance)
        z = (t - slope * m) / sd
        if np.count_nonzero(np.abs(z) < 3) < max(STRAY * len(z), 5):
            return None
        near = (z > LOW) & (z < HIGH)
        z, sd, m_near = z[near], sd[near], m[near]
        counts = np.bincount(((z - LOW) * (1 / STEP)).astype(np.intp), minlength=len(CENTRES))
        share = weights(counts.astype(float), np.maximum(share, 1e-4))
        psi = np.interp(z, CENTRES, score(share))
        own = (noise[2][near] - slope * noise[1][near]) / sd  # the noise of m that goes with one sd of z
        pull = (m_near - own * psi) / sd
        information = float((pull * psi) @ (pull * psi))
        step = float(pull @ psi) / max(information, 1e-300)
        slope += step
        if step * step * information < 1e-3:
            break
    return _Level(slope=slope, share=share, information=information)
