"""A photograph as a fit sees it, and the scales that it sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Noise, Scene

from .cells import Cells
from .model import Lit, lit_by


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """One photograph: its scene, its samples in cells, its noise."""

    scene: Scene
    cells: Cells
    noise: Noise
    lights: tuple[Lit, ...]  # at the cells' nodes

    @classmethod
    def of(cls, scene: Scene, cells: Cells, noise: Noise) -> View:
        """With the lights worked out at the cells."""
        return cls(scene=scene, cells=cells, noise=noise, lights=lit_by(scene, *cells.nodes()))

    def moved(self, scene: Scene) -> View:
        """The same samples, seen in another scene."""
        return self if scene is self.scene else View.of(scene, self.cells, self.noise)


def signal_scale(cells: Cells) -> float:
    """The photograph's own radiance scale: 99th percentile of the cells of its brightest channel."""
    return max(float(np.percentile(data.means, 99)) if data.cells else 0.0 for data in cells.channels)


def irradiance_scale(scene: Scene) -> float:
    """The mean irradiance of a scene's lights over lights and channels."""
    return max(float(np.mean([lamp.at(np.zeros((1, 3)))[1] for lamp in scene.lights])), 1e-12)
