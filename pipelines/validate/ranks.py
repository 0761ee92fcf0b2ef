"""Where a truth stands among its posterior draws: uniform where intervals are right (Talts et al. 2018).

Whether ranks are uniform is judged along their whole distribution at once (Säilynoja, Bürkner & Vehtari 2022): the
chance that the ranks of a right posterior leave the most extreme of its pointwise binomial bands as far as these do.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from toolkit.records import Floats

LEVELS = (0.5, 0.68, 0.9, 0.95)
BAND = 0.99  # of right posteriors stay inside it all along
SIMULATED, POINTS = 4000, 60


def covered(ranks: Floats) -> dict[float, float]:
    """Share of central intervals at each level that hold their truth, from ranks in 0..1."""
    return {level: float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level)) for level in LEVELS}


def uniform_p(ranks: Floats) -> float:
    """Chance that as many even ranks look as uneven as these (N,) do anywhere along their distribution."""
    null = _most_extreme_of_even(len(ranks))
    mine = _most_extreme(np.sort(ranks)[None])[0]
    return float((np.count_nonzero(null <= mine) + 1) / (len(null) + 1))


def band(count: int) -> tuple[Floats, Floats, Floats]:
    """Places in 0..1, and the lowest and highest share of `count` even ranks below each, in `BAND` of cases."""
    from scipy.stats import binom

    at = np.arange(POINTS + 1) / POINTS
    level = 0.5 * float(np.quantile(_most_extreme_of_even(count), 1.0 - BAND))
    low, high = binom.ppf(level, count, at), binom.isf(level, count, at)
    return at, np.asarray(low) / count, np.asarray(high) / count


@cache
def _most_extreme_of_even(count: int) -> Floats:
    draws = np.random.default_rng(0).random((SIMULATED, count))
    return _most_extreme(np.sort(draws, axis=1))


def _most_extreme(ordered: Floats) -> Floats:
    """Smallest two-sided pointwise binomial probability along each row's empirical distribution (S, N)."""
    from scipy.stats import binom

    rows, count = ordered.shape
    at = np.arange(1, POINTS) / POINTS
    below = np.stack([np.searchsorted(row, at, side="right") for row in ordered])
    table = np.minimum(
        binom.cdf(np.arange(count + 1)[:, None], count, at), binom.sf(np.arange(count + 1)[:, None] - 1, count, at)
    )
    return np.asarray(np.minimum(2.0 * table[below, np.arange(len(at))], 1.0).min(axis=1)).reshape(rows)
