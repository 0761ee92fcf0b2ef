"""The light's colour by inverse-intensity chromaticity.

Tan, Nishino & Ikeuchi 2004, "Color constancy through inverse-intensity chromaticity space", JOSA A 21. With
chromaticity sigma_c = x_c / sum x, highlight pixels of one body brightness lie on a line sigma_c = p / sum x + Gamma_c
whose intercept is the light's chromaticity. Each pixel votes for all (Gamma, p) on its line (their Hough transform,
section 4); here p = x_c - Gamma sum x, and the Gamma whose votes meet most often, counted in pairs, is taken. Least
squares over the pixels on its line tell it more finely than the bins of the votes.
The shading under the highlight spreads the lines; the quarters of the highlight, each asked alone, tell by how much.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .illuminant import Illuminant, unit_colour
from .plane import DichromaticPlane, dichromatic_plane
from .samples import Blocks, Mask, Samples, block_size, blocks

STEP = 0.002  # of the chromaticity searched
CORE = 0.1  # of the strongest highlight
FEWEST = 40  # blocks of highlight
ACROSS = 2.0  # width of a bin of p, in sd of the noise
LEAST_BIN = 0.005  # of the brightest block: without noise the shading still spreads p
REFITS = 3
WORST_DEG = 20.0
SHARED = 2.0  # the quarters share the shading's pull: on rendered spheres the error is twice what their spread tells


def by_inverse_intensity(ready: Samples) -> Illuminant | None:
    """The light's colour with its error; None where too little highlight is seen."""
    size = block_size(ready)
    plane = dichromatic_plane(blocks(ready, size))
    if plane is None:
        return None
    cloud = blocks(ready, max(size // 2, 1))
    core = _highlight(cloud, plane)
    if np.count_nonzero(core) < FEWEST:
        return None
    colour, variance = cloud.colour[core], cloud.variance[core]
    whole = _intercept(colour, variance)
    parts = [_intercept(colour[q], variance[q]) for q in _quarters(cloud.x[core], cloud.y[core])]
    if whole is None or any(part is None for part in parts):
        return None
    off = np.array([part - whole for part in parts if part is not None])
    off_plane = _off_plane(colour, variance, plane) ** 2 / 2 * (np.eye(3) - np.outer(whole, whole))
    found = Illuminant(
        colour=whole,
        covariance=SHARED**2 * off.T @ off / len(off) + off_plane,
        source="inverse-intensity",
        reason="inverse-intensity chromaticity of the highlight",
    )
    return found if found.sd_deg < WORST_DEG else None


def _highlight(cloud: Blocks, plane: DichromaticPlane) -> Mask:
    h = cloud.colour @ plane.across
    noise = 6 * np.sqrt(cloud.variance @ plane.across**2)
    return np.asarray(h > np.maximum(CORE * float(np.quantile(h, 0.995)), noise))


def _off_plane(colour: Floats, variance: Floats, plane: DichromaticPlane) -> float:
    """Rms distance of the highlight from the plane beyond the noise, over the highlight's rms."""
    off, h = colour @ plane.normal, colour @ plane.across
    beyond = float(off @ off - (variance @ plane.normal**2).sum() * (1 + 3 * np.sqrt(2 / len(off))))
    return float(np.sqrt(max(beyond, 0.0) / max(float(h @ h), 1e-300)))


def _quarters(x: Floats, y: Floats) -> list[Mask]:
    """Index masks of the four quarters about the medians."""
    right, low = x > np.median(x), y > np.median(y)
    return [right & low, right & ~low, ~right & low, ~right & ~low]


def _intercept(colour: Floats, variance: Floats) -> Floats | None:
    """Unit colour (3,) from the votes of blocks (n, 3); None for fewer than ten."""
    if len(colour) < 10:
        return None
    total = colour.sum(axis=1)
    found = np.array([_most_meetings(colour[:, c], total, variance[:, c]) for c in range(3)])
    return unit_colour(np.maximum(found, 0.0)) if found.max() > 0 else None


def _most_meetings(one: Floats, total: Floats, variance: Floats) -> float:
    """The chromaticity in 0..1 at which p = one - chromaticity x total piles up most."""
    width = max(ACROSS * float(np.sqrt(np.median(variance))), LEAST_BIN * float(total.max()))
    tried = np.arange(0.0, 1.0, STEP)
    pairs = np.empty(len(tried))
    for i, gamma in enumerate(tried):
        votes = np.floor((one - gamma * total) / width).astype(np.intp)
        counts = np.bincount(votes - votes.min())
        soft = counts[:-1] + counts[1:] if len(counts) > 1 else counts  # neighbouring bins meet as well
        pairs[i] = float(soft @ soft)
    best = int(np.argmax(pairs))
    around = slice(max(best - 3, 0), best + 4)
    weight = pairs[around] - 0.5 * pairs[best]
    weight = np.maximum(weight, 0.0)
    return _along_the_line(one, total, float(tried[around] @ weight / weight.sum()), width)


def _along_the_line(one: Floats, total: Floats, chromaticity: float, width: float) -> float:
    """The votes say which blocks lie on the line; what its intercept is, least squares over those tell better."""
    for _ in range(REFITS):
        p = one - chromaticity * total
        votes = np.floor((p - p.min()) / width).astype(np.intp)
        most = p.min() + (int(np.argmax(np.bincount(votes))) + 0.5) * width
        on = np.abs(p - float(np.median(p[np.abs(p - most) <= width]))) <= width
        away = total[on] - total[on].mean()
        spread = float(away @ away)
        if spread == 0:
            break
        chromaticity += float(away @ p[on]) / spread
    return float(np.clip(chromaticity, 0.0, 1.0))
