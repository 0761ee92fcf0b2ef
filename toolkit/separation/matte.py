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
real one last, so that clean and noisy pictures take the same path. The coarse noise is added as its average, counts
and psi convolved with it, so that every level is a proper fit to noisier samples, and how the slope moves from one to
the next tells how far the tail pulls it (as in simulation extrapolation: Cook & Stefanski 1994, JASA 89).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

LOW, HIGH, STEP = -8.0, 24.0, 0.125  # the window of z = (t - slope m) / sd that the mixture describes
WIDTHS = (1.5, 3.0, 6.0, 24.0)  # of the half-uniforms, in sd; a narrower one passes for a shifted point mass
PREFERENCE = 0.01  # for the point mass, as a share of the samples: where nothing decides, a pixel is matte
STRAY = 0.001  # of the samples belong to no component: dust, a foreign pixel
FIRST_NOISE = 0.02  # of the largest m: the noise that the first and coarsest level pretends
LOUDER = 2.0  # that noise is at least so many times the real one: with one level only, a tail's pull would not show
FINER = 0.25  # from level to level
FALL = 0.75  # power of the noise with which the tail's pull falls; on rendered spheres 0.65 to 0.9
APART = 1.3  # ratio of two levels' noise that tells a fall
FINEST = 1e-12  # of the largest m: rounding
FEWEST = 5  # samples on the line, below which a level says nothing


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


def weights(counts: Floats, start: Floats, rounds: int = 4) -> Floats:
    """Weights (components,) of the mixture by expectation-maximisation from counts (bins,)."""
    share = start
    stray = STRAY / (HIGH - LOW)
    total = max(float(counts.sum()), 1.0)
    for _ in range(rounds):
        joint = share[:, None] * DENSITY
        share = joint @ (counts / (joint.sum(axis=0) + stray)) / total
        share[0] += PREFERENCE
        share /= share.sum()
    return np.asarray(share)


def score(share: Floats) -> Floats:
    """Psi = -f'/f on the bins: the noise that each z is expected to hold, in sd."""
    f = share @ DENSITY + STRAY / (HIGH - LOW)
    return np.asarray(-(share @ SLOPE) / f)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Cloud:
    """Samples (n,) along the light, t, and across it, m, with the noise of each and what the two share."""

    t: Floats
    m: Floats
    var_t: Floats
    var_m: Floats
    cov: Floats

    def variance(self, slope: float, pretend: float) -> Floats:
        """Of t - slope m, the pretended noise on top."""
        return np.asarray(self.var_t + slope**2 * self.var_m - 2 * slope * self.cov + pretend**2)

    def where(self, keep: NDArray[np.bool_]) -> _Cloud:
        return _Cloud(
            t=self.t[keep], m=self.m[keep], var_t=self.var_t[keep], var_m=self.var_m[keep], cov=self.cov[keep]
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Level:
    """The line at one level of noise, the mixture's weights, the slope's information, the scatter about the line."""

    slope: float
    share: Floats
    information: float = 0.0
    scatter: float = 0.0


def _blur(sd: float) -> Callable[[Floats], Floats]:
    """What a function (bins,) of z becomes on average under added noise of `sd`."""
    if sd < STEP / 2:
        return lambda values: values
    reach = int(4 * sd / STEP)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * (STEP / sd)) ** 2)
    kernel /= kernel.sum()
    return lambda values: np.convolve(values, kernel, mode="same")


def lower_edge(t: Floats, m: Floats, var_t: Floats, var_m: Floats, cov: Floats) -> Edge:
    """Fit t = slope m + s, s >= 0, to samples (N,), m > 0, with their noise (N,) each, all in the same units."""
    top = float(np.quantile(m, 0.98))
    cloud = _Cloud(t=t, m=m, var_t=var_t + (FINEST * top) ** 2, var_m=var_m, cov=cov)
    bright = m > 0.3 * top
    start = float(np.quantile(t[bright] / m[bright], 0.1))
    found = _Level(slope=start, share=np.full(len(DENSITY), 1.0 / len(DENSITY)))
    history: list[tuple[float, float]] = []
    floor = max(0.5 * float(np.sqrt(np.median(cloud.variance(start, 0.0)))), FINEST * top)
    pretend = max(FIRST_NOISE * top, LOUDER * 2 * floor)
    while pretend >= 0:
        finer = _settle(cloud, _below_cloud(cloud, found, pretend, 0.3 * top), pretend)
        if finer is None:
            break
        found = finer
        history.append((math.hypot(pretend, 2 * floor), found.slope))
        away = cloud.t - found.slope * cloud.m
        # what lies beyond the window at this level cannot come back at a finer one
        cloud = cloud.where(away < HIGH * np.sqrt(cloud.variance(found.slope, pretend)))
        pretend = _next(pretend, found.scatter, floor)
    sd = math.sqrt(1.0 / max(found.information, 1.0 / (1 + found.slope**2)) + _pull(history) ** 2)
    return Edge(slope=found.slope, sd=sd, matte_share=float(found.share[0]))


def _pull(history: Sequence[tuple[float, float]]) -> float:
    """How far the highlight's tail still pulls the slope up, from how it fell with the noise (noise, slope) so far."""
    for noise, slope in reversed(history[:-1]):
        ratio = min(noise / history[-1][0], 16.0)
        if ratio > APART:
            return max(float((slope - history[-1][1]) / (ratio**FALL - 1)), 0.0)  # a tail never pulls down
    return 0.0


def _next(pretend: float, scatter: float, floor: float) -> float:
    """A finer pretended noise, 0 once the real one rules, -1 after that; straight to what scatter there is."""
    if pretend == 0:
        return -1.0
    finer = min(pretend * FINER, max(2 * scatter, floor))
    return finer if finer > floor else 0.0


def _below_cloud(cloud: _Cloud, level: _Level, pretend: float, faint: float) -> _Level:
    """The line lowered until no more than strays lie under it: highlights only ever add."""
    bright = cloud.m > faint
    reach = cloud.t[bright] + 3 * np.sqrt(cloud.variance(level.slope, pretend)[bright])
    if not reach.size:
        return level
    ceiling = float(np.quantile(reach / cloud.m[bright], STRAY))
    return _Level(slope=min(level.slope, ceiling), share=level.share)


def _settle(cloud: _Cloud, level: _Level, pretend: float, rounds: int = 30) -> _Level | None:
    """Fisher scoring at one level; None where hardly a sample lies on the line: there is nothing finer to see."""
    slope, share, information = level.slope, level.share, 0.0
    for _ in range(rounds):
        sd = np.sqrt(cloud.variance(slope, pretend))
        blur = _blur(pretend / float(np.median(sd)))
        z = (cloud.t - slope * cloud.m) / sd
        if np.count_nonzero(np.abs(z) < 3) < max(STRAY * len(z), FEWEST):
            return None
        near = (z > LOW) & (z < HIGH)
        z, sd = z[near], sd[near]
        counts = np.bincount(((z - LOW) * (1 / STEP)).astype(np.intp), minlength=len(CENTRES))
        share = weights(blur(counts.astype(float)), np.maximum(share, 1e-4))
        noise = score(share)
        psi, square = (np.interp(z, CENTRES, blur(each)) for each in (noise, noise**2))
        each = float(np.sum(share @ DENSITY * noise**2) * STEP)  # information of one sample, in 1 / sd^2
        own = (cloud.cov[near] - slope * cloud.var_m[near]) / sd  # the noise of m that goes with one sd of z
        m = cloud.m[near]
        information = each * float(np.sum(((m - own * psi) / sd) ** 2))
        step = float(np.sum((m * psi - own * square) / sd)) / max(information, 1e-300)
        slope += step
        if step * step * information < 1e-4:
            break
    scatter = float(np.median(np.abs(z[np.abs(z) < 3])) * np.median(sd))
    return _Level(slope=slope, share=share, information=information, scatter=scatter)
