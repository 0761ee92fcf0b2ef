"""What a cloud of colours looks like: a point, a line, a plane or a volume (Klinker, Shafer & Kanade 1990, 4.2).

The singular values of the cloud about its mean are held against what noise alone would give.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from toolkit.records import Floats, readonly

from .samples import Blocks

Kind = Literal["point", "line", "plane", "volume"]
SIGNIFICANT = 6.0  # sd of a noise eigenvalue above its expectation
THIN = 0.06  # a plane's thickness over its width, beyond which it is a volume ...
FLAT = 0.015  # ... where it also is this part of its length: lenses alone leave 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cluster:
    """`extent` (3,) is the rms spread along each axis beyond the noise, largest first, radiance."""

    kind: Kind
    extent: Floats
    noise: Floats  # (3,) rms of the noise along the same axes

    def __post_init__(self) -> None:
        readonly(self)


def classify(cloud: Blocks) -> Cluster:
    """Kind and extent of the cloud of block means."""
    spread = cloud.colour - cloud.colour.mean(axis=0)
    count = len(spread)
    values, axes = np.linalg.eigh(spread.T @ spread / count)
    values, axes = values[::-1], axes[:, ::-1]
    noise = (axes**2 * cloud.variance.mean(axis=0)[:, None]).sum(axis=0)
    beyond = np.maximum(values - noise * (1 + SIGNIFICANT * np.sqrt(2 / count)), 0.0)
    extent = np.sqrt(np.where(beyond > 0, np.maximum(values - noise, 0.0), 0.0))
    return Cluster(kind=_kind(extent), extent=extent, noise=np.sqrt(noise))


def _kind(extent: Floats) -> Kind:
    if extent[0] == 0:
        return "point"
    if extent[1] == 0:
        return "line"
    return "volume" if extent[2] > max(THIN * extent[1], FLAT * extent[0]) else "plane"
