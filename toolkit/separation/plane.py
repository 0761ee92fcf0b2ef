"""The plane of one body's colours, found without knowing the light: body colour, and the way to the highlight.

Through the origin, by total least squares with the noise taken off. Within it the matte line is the edge on the side
away from the tail: the light's colour lies on the other side of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .matte import lower_edge
from .samples import Blocks

FAINTEST = 0.15  # of the brightest blocks: fainter ones say nothing of the edge
SIGNIFICANT = 6.0  # sd of a noise eigenvalue that the plane's width must exceed
CLEAR = 0.1  # correlation of hue with brightness beyond which it tells the highlight's side


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DichromaticPlane:
    """Unit `normal` (3,) with covariance (3, 3); within the plane unit `body` and, at right angles, `across` (3,).

    `across` points to the highlight's side. `body_sd` is the body's error within the plane, radians.
    """

    normal: Floats
    covariance: Floats
    body: Floats
    body_sd: float
    across: Floats

    def __post_init__(self) -> None:
        readonly(self)


def dichromatic_plane(cloud: Blocks) -> DichromaticPlane | None:
    """The plane of the cloud of block means (n, 3); None where it has no width beyond the noise: no highlight."""
    colour, noise = cloud.colour, cloud.variance.sum(axis=0)
    values, axes = np.linalg.eigh(colour.T @ colour - np.diag(noise))
    typical = float(noise.mean())
    if values[1] < typical * SIGNIFICANT * np.sqrt(2 / len(colour)):
        return None
    normal = axes[:, 0]
    within = axes[:, 1:]
    off = colour @ normal
    misfit = max(float(off @ off) / max(float(noise @ normal**2), 1e-300), 1.0)
    inverse = within @ np.diag(1 / np.maximum(values[1:], 1e-300)) @ within.T
    covariance = misfit * float((cloud.variance @ normal**2).mean()) * inverse
    return _matte_side(cloud, normal, covariance, axes[:, 2])


def _matte_side(cloud: Blocks, normal: Floats, covariance: Floats, main: Floats) -> DichromaticPlane:
    main = main * (np.sign(main.sum()) or 1.0)
    across = np.cross(normal, main)
    m, t = cloud.colour @ main, cloud.colour @ across
    use = m > FAINTEST * float(np.quantile(m, 0.98))
    if not _highlight_above(t[use] / m[use], m[use]):
        across, t = -across, -t
    variance = cloud.variance[use]
    edge = lower_edge(t[use], m[use], variance @ across**2, variance @ main**2, variance @ (across * main))
    body = (main + edge.slope * across) / np.hypot(1.0, edge.slope)
    turned = (across - edge.slope * main) / np.hypot(1.0, edge.slope)
    return DichromaticPlane(
        normal=normal, covariance=covariance, body=body, body_sd=edge.sd / (1 + edge.slope**2), across=turned
    )


def _highlight_above(ratio: Floats, brightness: Floats) -> bool:
    """Which side of the cluster the highlight is on: that of the brighter blocks, else that of the longer tail."""
    away = ratio - np.median(ratio)
    spread = float(np.std(ratio) * np.std(brightness))
    lean = float(np.mean(away * (brightness - brightness.mean()))) / spread if spread > 0 else 0.0
    return lean > 0 if abs(lean) > CLEAR else bool(np.mean(away**3) >= 0)
