"""How well a chain has sampled: autocorrelation time, effective samples, split R-hat."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

WINDOW = 5.0  # autocorrelation times that the sum over lags goes on for


def autocorrelation_time(chain: Floats) -> float:
    """Longest integrated autocorrelation time over the parameters of a chain (steps, walkers, parameters).

    Over the walkers' mean autocovariance with Sokal's window (Goodman & Weare 2010, CAMCoS 5), as emcee's own; but
    about the mean of all walkers. About each walker's own, times of a chain of 50 of them are told a fifth too short,
    and walkers that never leave their places seem to mix.
    """
    steps = len(chain)
    away = chain - chain.mean(axis=(0, 1))
    power = np.abs(np.fft.rfft(away, 2 * steps, axis=0)) ** 2
    covariance = np.fft.irfft(power.mean(axis=1), axis=0)[:steps] / np.arange(steps, 0, -1)[:, None]
    times = 2.0 * np.cumsum(covariance / covariance[0], axis=0) - 1.0
    short = np.arange(steps)[:, None] < WINDOW * times
    last = np.where(short.all(axis=0), steps - 1, np.argmin(short, axis=0))
    return float(np.max(np.take_along_axis(times, last[None], axis=0)))


def split_r_hat(chains: Floats) -> float:
    """Split R-hat of one quantity over chains (chains, draws): Gelman et al., Bayesian Data Analysis, 3rd ed., 11.4."""
    half = chains.shape[1] // 2
    if half < 2:
        return float("inf")
    parts = np.concatenate([chains[:, :half], chains[:, -half:]])
    within = parts.var(axis=1, ddof=1).mean()
    between = half * parts.mean(axis=1).var(ddof=1)
    if within <= 0:
        return 1.0
    return float(np.sqrt(((half - 1) / half * within + between / half) / within))
