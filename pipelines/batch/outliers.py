"""Who lies far out: each photograph against its material's others."""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .pool import LEVEL


def far_out(values: Floats, sds: Floats) -> Floats:
    """How far (k,) each value lies from the others' mean, in sds of that distance; NaN for fewer than four.

    The others' scatter is by moments; |z| beyond `far_threshold` marks an outlier.
    """
    y, variance = np.asarray(values, float), np.asarray(sds, float) ** 2
    k = len(y)
    if k < 4:
        return np.full(k, np.nan)
    weight = 1 / variance
    w1, w2 = weight.sum() - weight, np.sum(weight**2) - weight**2
    mean = (np.sum(weight * y) - weight * y) / w1
    q = np.sum(weight * y**2) - weight * y**2 - w1 * mean**2
    between = np.maximum(0.0, (q - (k - 2)) / (w1 - w2 / w1))
    total = np.array([_others(y, variance, between[i], i) for i in range(k)])
    return np.asarray((y - total[:, 0]) / np.sqrt(variance + between + total[:, 1]))


def _others(y: Floats, variance: Floats, between: float, left_out: int) -> tuple[float, float]:
    """Mean of all but one, and its variance."""
    weight = 1 / (variance + between)
    weight[left_out] = 0.0
    return float(np.sum(weight * y) / weight.sum()), float(1 / weight.sum())


def far_threshold(count: int) -> float:
    """The |z| that one of `count` photographs exceeds by chance once in twenty batches (Sidak's correction, Student's
    t of count - 2).
    """
    from scipy.stats import t

    alone = 1 - LEVEL ** (1 / count)
    return float(t.isf(alone / 2, max(count - 2, 1)))
