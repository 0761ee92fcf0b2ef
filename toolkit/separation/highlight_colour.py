"""The light's colour from one body: the T's highlight line, with the body's shading under the highlight taken out.

Klinker, Shafer & Kanade read the light's colour off the highlight line. On a rough surface the highlight is broad, the
body's shading changes beneath it, and the line leans by ten degrees and more. But the shading is smooth where the
highlight is not: with m along the body colour and h across it, m = shading(x, y) + kappa h, and kappa, the lean of
the light's colour, follows by least squares with the shading as a quadratic over the highlight's neighbourhood. The
noise of h is taken off (errors in variables). A cubic in its place tells how far the shading can be trusted.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from toolkit.records import Floats

from .illuminant import Illuminant, unit_colour
from .plane import DichromaticPlane, dichromatic_plane
from .samples import Blocks, Mask, Samples, block_size, blocks

CORE = 0.1  # of the strongest highlight: blocks above it show where the highlight lies
REACH = 1.0  # of the neighbourhood's radius over sqrt(2) times the highlight's rms radius
FEWEST = 40  # blocks in the neighbourhood: well more than the unknowns of a cubic
ENOUGH = 20_000  # blocks in all, beyond which finer ones only cost time
WORST_DEG = 20.0  # stated error beyond which there is no answer


def by_highlight_line(ready: Samples) -> Illuminant | None:
    """The light's colour with its error; None where no highlight stands out, or it tells nothing."""
    size = block_size(ready)
    plane = dichromatic_plane(blocks(ready, size))
    if plane is None:
        return None
    found = []
    while size >= 1:  # small highlights need small blocks, broad ones the low noise of large ones
        cloud = blocks(ready, size)
        found.append(_from_blocks(cloud, plane))
        if len(cloud.weight) > ENOUGH:
            break
        size //= 2
    heard = [each for each in found if each is not None]
    return _agree(min(heard, key=lambda each: each.sd_deg), heard) if heard else None


def _agree(best: Illuminant, all_sizes: list[Illuminant]) -> Illuminant:
    """The best with what the block sizes disagree by, beyond their errors, in its covariance."""
    excess = [float(np.sum((each.colour - best.colour) ** 2) - np.trace(each.covariance)) for each in all_sizes]
    more = float(np.mean(np.maximum(excess, 0.0)))
    across = np.eye(3) - np.outer(best.colour, best.colour)
    return dataclasses.replace(best, covariance=best.covariance + more / 2 * across)


def _from_blocks(cloud: Blocks, plane: DichromaticPlane) -> Illuminant | None:
    h = cloud.colour @ plane.across
    near = _neighbourhood(cloud, h)
    if near is None:
        return None
    where, x, y = near
    m = (cloud.colour @ plane.body)[where]
    h = h[where]
    variance = cloud.variance[where]
    noise = variance @ plane.across**2, variance @ (plane.across * plane.body)
    fits = [_lean(m, h, noise, _polynomials(x, y, degree)) for degree in (2, 3)]
    if fits[0] is None or fits[1] is None:
        return None
    (kappa, sd), (other, _) = fits[0], fits[1]
    off = _off_plane(cloud.colour[where] @ plane.normal, h, variance @ plane.normal**2, _polynomials(x, y, 2))
    return _illuminant(plane, kappa, float(np.hypot(sd, other - kappa)), off)


def _off_plane(off: Floats, h: Floats, variance: Floats, shading: Floats) -> float:
    """Rms distance from the plane beyond the noise, over the highlight's rms: what is wrong there in any direction.

    Colour fringes of the lens, a second hue, a mirrored room: none of them keeps to the plane, and what of them
    lies within it cannot be seen.
    """
    free = 1 - shading.shape[1] / len(off)
    rest_off, rest_h = off - shading @ (shading.T @ off), h - shading @ (shading.T @ h)
    beyond = float(rest_off @ rest_off) - free * float(variance.sum()) * (1 + 3 * np.sqrt(2 / len(off)))
    return float(np.sqrt(max(beyond, 0.0) / (rest_h @ rest_h)))


def _neighbourhood(cloud: Blocks, h: Floats) -> tuple[Mask, Floats, Floats] | None:
    """Which blocks (n,) lie about the highlight, and their offsets from its middle over its radius."""
    top = float(np.quantile(h, 0.995))
    core = h > max(CORE * top, 6 * float(np.sqrt(np.median(cloud.variance))))
    if np.count_nonzero(core) < 5:
        return None
    cx, cy = np.average(cloud.x[core], weights=h[core]), np.average(cloud.y[core], weights=h[core])
    spread = np.mean((cloud.x[core] - cx) ** 2 + (cloud.y[core] - cy) ** 2)
    radius = REACH * float(np.sqrt(2 * spread)) + cloud.size
    x, y = (cloud.x - cx) / radius, (cloud.y - cy) / radius
    where = x * x + y * y < 1
    if np.count_nonzero(where) < FEWEST:
        return None
    return where, x[where], y[where]


def _polynomials(x: Floats, y: Floats, degree: int) -> Floats:
    """Orthonormal columns (n, k) spanning all polynomials up to `degree`."""
    columns = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.asarray(np.linalg.qr(np.stack(columns, axis=1))[0])


def _lean(m: Floats, h: Floats, noise: tuple[Floats, Floats], shading: Floats) -> tuple[float, float] | None:
    """Kappa and its sd, the shading projected out and the noise of h taken off."""
    rest_m, rest_h = m - shading @ (shading.T @ m), h - shading @ (shading.T @ h)
    free = 1 - shading.shape[1] / len(m)
    power = float(rest_h @ rest_h) - free * float(noise[0].sum())
    if power < 0.5 * float(rest_h @ rest_h):
        return None  # what is left of the highlight is mostly noise
    kappa = (float(rest_h @ rest_m) - free * float(noise[1].sum())) / power
    left = rest_m - kappa * rest_h
    return kappa, float(np.sqrt(left @ left / (free * len(m)) / power))


def _illuminant(plane: DichromaticPlane, kappa: float, sd: float, off: float) -> Illuminant | None:
    """From kappa = cotangent of the angle between body and light, within the plane."""
    length = float(np.hypot(1.0, kappa))
    colour = (kappa * plane.body + plane.across) / length
    along = (plane.body - kappa * plane.across) / length  # how the colour turns within the plane
    within = (sd**2 + off**2) / length**4
    covariance = within * np.outer(along, along)
    across = float(colour @ plane.covariance @ colour) + off**2 / length**2
    covariance += across * np.outer(plane.normal, plane.normal)
    if not np.any(colour > 0):
        return None
    found = Illuminant(
        colour=unit_colour(np.maximum(colour, 0)),
        covariance=covariance,
        source="highlight-line",
        reason="the T's highlight line, the shading under it taken out",
    )
    slack = np.radians(found.sd_deg) * 2 + 0.05
    return found if np.all(colour > -slack) and found.sd_deg < WORST_DEG else None
