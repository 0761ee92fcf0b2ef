"""Proposals that know the density: drawn from its values on a grid, whatever the place that is left.

An independence sampler (Tierney 1994, "Markov chains for exploring posterior distributions", Ann. Stat. 22, 2.3.3).
Between the grid's points its density is linear along each axis; what that lacks of the density itself, the Hastings
ratio makes up for. Since no proposal depends on where a walker stands, those of many steps are drawn at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly

from .surrogate import Surrogate

POINTS = {1: 257, 2: 65, 3: 33, 4: 17, 5: 9}  # along each axis
LEAST = 1e-300  # of the largest density, below which a point counts as that
AHEAD = 32  # steps whose proposals are drawn at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridProposal:
    """A density that is linear between the points of a grid over a box: a sum of tents, one on each point."""

    low: Floats  # (D,)
    width: Floats  # (D,), between neighbours
    height: Floats  # (points,) * D, the density at the points, up to a factor
    share: Floats  # cumulative, of the tents in order, of what is within the box

    def __post_init__(self) -> None:
        readonly(self)

    @classmethod
    def of(cls, surrogate: Surrogate) -> GridProposal:
        """Through the density at points from end to end of the surrogate's box."""
        dimensions = len(surrogate.low)
        points = POINTS[dimensions]
        density = surrogate.on_grid(np.linspace(-1.0, 1.0, points))
        height = np.maximum(np.exp(density - density.max()), LEAST)
        share = height.copy()
        for d in range(dimensions):  # of a tent on an end half is within
            np.moveaxis(share, d, 0)[[0, -1]] *= 0.5
        share = np.cumsum(share)
        width = (surrogate.high - surrogate.low) / (points - 1)
        return cls(low=surrogate.low, width=width, height=height, share=share / share[-1])

    def draw(self, count: int, random: np.random.RandomState) -> Floats:
        """Places (count, D)."""
        tents = np.searchsorted(self.share, random.random_sample(count), side="right")
        shape = count, len(self.low)
        at = np.stack(np.unravel_index(tents, self.height.shape), axis=-1)
        at = np.abs(at + random.random_sample(shape) - random.random_sample(shape))
        last = len(self.height) - 1
        return np.asarray(self.low + self.width * np.where(at > last, 2 * last - at, at))

    def log_density(self, places: Floats) -> Floats:
        """At places (S, D), up to a constant."""
        at = (places - self.low) / self.width
        corner = np.minimum(at.astype(np.intp), len(self.height) - 2)
        beyond = (at - corner).T
        parts = 1.0 - beyond, beyond
        heights, strides = self.height.ravel(), len(self.height) ** np.arange(len(self.low))[::-1]
        first, found = corner @ strides, np.zeros(len(places))
        for sides in product((0, 1), repeat=len(self.low)):
            part = heights[first + sides @ strides]
            for d, side in enumerate(sides):
                part *= parts[side][d]
            found += part
        return np.asarray(np.log(found))


class _State(Protocol):
    """emcee's: where the walkers stand (K, D), and the log density there (K,)."""

    coords: Floats
    log_prob: Floats


class _Model(Protocol):
    """emcee's: what a move may use."""

    random: np.random.RandomState


class Anywhere:
    """A move of emcee's, for all walkers at once, to places that a grid proposes; of one walk alone.

    `log_density` is the walk's own, of places (S, D).
    """

    def __init__(self, grid: GridProposal, log_density: Callable[[Floats], Floats]) -> None:
        self.grid, self.log_density = grid, log_density
        self.ahead: Iterator[tuple[Floats, Floats, Floats]] | None = None
        self.stood: Floats = np.zeros((0, 0))  # where the walkers were left, so that only what moved is looked up
        self.odds: Floats = np.zeros(0)  # theirs, of the density over that of the proposals

    def propose(self, model: _Model, state: _State) -> tuple[_State, NDArray[np.bool_]]:
        """As emcee asks a move: the state with what was accepted, and whether it was of each walker."""
        if self.ahead is None:
            self.ahead = self._proposed(len(state.coords), model.random)
            self.stood, self.odds = np.full_like(state.coords, np.nan), np.empty(len(state.coords))
        there, density, odds = next(self.ahead)
        if (moved := (state.coords != self.stood).any(axis=1)).any():
            self.odds[moved] = state.log_prob[moved] - self.grid.log_density(state.coords[moved])
        accepted = np.log(model.random.random_sample(len(there))) < odds - self.odds
        state.coords[accepted], state.log_prob[accepted] = there[accepted], density[accepted]
        self.stood, self.odds = state.coords.copy(), np.where(accepted, odds, self.odds)
        return state, accepted

    def _proposed(self, walkers: int, random: np.random.RandomState) -> Iterator[tuple[Floats, Floats, Floats]]:
        """For each step places, their log density, and that over the density that they are proposed with."""
        while True:
            places = self.grid.draw(AHEAD * walkers, random)
            density = self.log_density(places)
            odds = density - self.grid.log_density(places)
            for first in range(0, len(places), walkers):
                mine = slice(first, first + walkers)
                yield places[mine], density[mine], odds[mine]
