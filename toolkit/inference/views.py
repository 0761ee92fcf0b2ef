"""A photograph as a fit sees it, and the scales that it sets."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Noise, Scene

from .cells import Cells
from .lit import Lit, lit_on


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """One photograph: its scene, its samples in cells, its noise."""

    scene: Scene
    gathered: Cells  # as the pixels are
    noise: Noise
    cells: Cells  # as wide as the scene's camera makes them
    seen: Surface  # at the cells' nodes
    lights: tuple[Lit, ...]  # there
    whole: bool  # whether sized lights are left whole

    @classmethod
    def of(cls, scene: Scene, gathered: Cells, noise: Noise, *, whole: bool = False) -> View:
        """With the lights worked out at the cells."""
        cells = gathered.blurred(scene.camera.blur_px2)
        seen = surface(scene.camera, scene.sphere, *cells.nodes())
        lights = lit_on(scene, seen, whole=whole)
        return cls(scene=scene, gathered=gathered, noise=noise, cells=cells, seen=seen, lights=lights, whole=whole)

    def moved(self, scene: Scene) -> View:
        """The same samples, seen in another scene."""
        return self if scene is self.scene else View.of(scene, self.gathered, self.noise, whole=self.whole)

    def thinned(self, every: int) -> View:
        """One cell in `every`, for a first search."""
        few = self.gathered.thinned(every)
        return replace(
            self,
            gathered=few,
            cells=few if self.cells is self.gathered else self.cells.thinned(every),
            seen=self.seen.thinned(every),
            lights=tuple(light.thinned(every) for light in self.lights),
        )

    def middles(self) -> View:
        """One node in the middle of each cell, for a look at where to begin: of no use to slopes."""
        return replace(self, lights=tuple(light.middles() for light in self.lights))

    def under_whole_lights(self) -> View:
        """For a lobe that holds a light's disc itself."""
        sized = any(light.angular_radius_deg for light in self.scene.lights)
        return View.of(self.scene, self.gathered, self.noise, whole=True) if sized and not self.whole else self


def signal_scale(cells: Cells) -> float:
    """The photograph's own radiance scale: 99th percentile of the cells of its brightest channel."""
    brightest = 0.0
    for means in (data.means for data in cells.channels if data.cells):
        if means.max() > brightest:
            brightest = max(brightest, _percentile_99(means))
    return brightest


def _percentile_99(values: Floats) -> float:
    """As np.percentile has it, which takes longer than a look at all cells."""
    below, part = divmod(0.99 * (len(values) - 1), 1.0)
    first, last = int(below), min(int(below) + 1, len(values) - 1)
    ordered = np.partition(values, (first, last))
    return float(ordered[first] + part * (ordered[last] - ordered[first]))


def irradiance_scale(scene: Scene) -> float:
    """The mean irradiance of a scene's lights over lights and channels."""
    return max(float(np.mean([lamp.at(np.zeros((1, 3)))[1] for lamp in scene.lights])), 1e-12)
