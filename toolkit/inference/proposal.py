"""Proposals that know the density: drawn from its values on a grid, whatever the place that is left.

An independence sampler (Tierney 1994, "Markov chains for exploring posterior distributions", Ann. Stat. 22, 2.3.3). The
grid's density is constant within a cell; what it lacks of the density itself, the Hastings ratio makes up for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .surrogate import Surrogate

CELLS = {1: 512, 2: 64, 3: 24, 4: 12, 5: 8}  # along each axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridProposal:
    """Called as emcee's `MHMove` wants it: new places (K, D), and the log of q(old) / q(new) (K,)."""

    low: Floats  # (D,)
    width: Floats  # (D,), of a cell
    density: Floats  # (cells, ...), log, up to a constant
    share: Floats  # cumulative, of the cells in order

    def __post_init__(self) -> None:
        readonly(self)

    @classmethod
    def of(cls, surrogate: Surrogate) -> GridProposal:
        """The density at the middles of the cells of the surrogate's box."""
        dimensions = len(surrogate.low)
        cells = CELLS[dimensions]
        density = surrogate.on_grid((2.0 * np.arange(cells) + 1.0) / cells - 1.0)
        share = np.cumsum(np.exp(density - density.max()))
        width = (surrogate.high - surrogate.low) / cells
        return cls(low=surrogate.low, width=width, density=density, share=share / share[-1])

    def __call__(self, places: Floats, random: np.random.RandomState) -> tuple[Floats, Floats]:
        """As emcee's `MHMove` asks."""
        cells = np.searchsorted(self.share, random.random_sample(len(places)), side="right")
        corner = np.stack(np.unravel_index(cells, self.density.shape), axis=-1)
        there = self.low + self.width * (corner + random.random_sample(places.shape))
        here = np.clip((places - self.low) / self.width, 0, np.array(self.density.shape) - 1).astype(np.intp)
        return there, self.density[tuple(here.T)] - self.density[tuple(corner.T)]
