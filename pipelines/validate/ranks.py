"""Where a truth stands among its posterior draws: uniform where intervals are right (Talts et al. 2018).

Whether ranks are uniform is judged along their whole distribution at once (Säilynoja, Bürkner & Vehtari 2022): the
chance that the ranks of a right posterior leave the most extreme of its pointwise binomial bands as far as these do.
Chances are exact, by the Poisson process that even ranks are once their number is left open (Moscovich & Nadler 2017):
simulated ones would end at one over the number of simulations, above what a family of histograms asks for.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

LEVELS = (0.5, 0.68, 0.9, 0.95)
BAND = 0.99  # of right posteriors stay inside it all along
POINTS = 60
HALVINGS = 30  # of the search for a band's level


def covered(ranks: Floats) -> dict[float, float]:
    """Share of central intervals at each level that hold their truth, from ranks in 0..1."""
    return {level: float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level)) for level in LEVELS}


def uniform_p(ranks: Floats) -> float:
    """Chance that as many even ranks look as uneven as these (N,) do anywhere along their distribution."""
    below = np.searchsorted(np.sort(ranks), _places(), side="right")
    chances = _pointwise(len(ranks))
    return max(1.0 - _staying(chances > chances[np.arange(POINTS + 1), below].min()), 0.0)


@cache
def band(count: int) -> tuple[Floats, Floats, Floats]:
    """Places in 0..1, and the lowest and highest share of `count` even ranks below each, in `BAND` of cases."""
    chances, low, high = _pointwise(count), 0.0, 1.0 - BAND
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _staying(chances >= middle) >= BAND else (low, middle)
    inside = chances >= low
    return _places(), inside.argmax(axis=1) / count, (count - inside[:, ::-1].argmax(axis=1)) / count


def _places() -> Floats:
    return np.arange(POINTS + 1) / POINTS


@cache
def _pointwise(count: int) -> Floats:
    """Two-sided binomial probability of every number of ranks below each place (POINTS + 1, count + 1)."""
    from scipy.stats import binom

    below, at = np.arange(count + 1), _places()[:, None]
    return np.asarray(np.minimum(2.0 * np.minimum(binom.cdf(below, count, at), binom.sf(below - 1, count, at)), 1.0))


def _staying(allowed: NDArray[np.bool_]) -> float:
    """Chance that even ranks have an allowed number below every place; `allowed` is (POINTS + 1, count + 1)."""
    from scipy.stats import poisson

    count = allowed.shape[1] - 1
    between = poisson.pmf(np.arange(count + 1), count / POINTS)
    state = allowed[0] * (np.arange(count + 1) == 0)
    for here in allowed[1:]:
        state = here * np.convolve(state, between)[: count + 1]
    return float(state[count] / poisson.pmf(count, count))
