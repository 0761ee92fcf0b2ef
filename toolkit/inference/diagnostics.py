"""How well a chain has sampled: autocorrelation time, effective samples, split R-hat."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats


def autocorrelation_time(chain: Floats) -> float:
    """Longest integrated autocorrelation time over the parameters of a chain (steps, walkers, parameters).

    emcee's estimator (Goodman & Weare 2010, Sokal's window), whatever the length: the caller compares it with the
    number of steps.
    """
    from emcee.autocorr import integrated_time

    return float(np.max(integrated_time(chain, tol=0, quiet=True)))


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
