"""Variance against signal as a straight line: robust bins, then weighted least squares within gain, read >= 0."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolkit.radiometry.highpass import OVERLAP
from toolkit.records import Floats

Integers = NDArray[np.integer[Any]]

_BINS = 64
_FEWEST = 200  # samples a bin
_MEDIAN = 0.7887  # of chi2 with 3 degrees of freedom, over 3: what the median of the mean of three squares is
_CAP = 3.5  # a sample counts at most so many times its expected variance: edges and hot pixels stay bounded
_CAPPED_MEAN = 0.98948  # E[min(x, _CAP)] of chi2 with 3 degrees of freedom, over 3
_ITERATIONS, _SETTLED = 30, 1e-4
_HUBER = 2.0  # bins further than so many scaled deviations from the line count less: one brightness may be textured


class Line(NamedTuple):
    """variance = gain * max(signal, 0) + offset, and the covariance (2, 2) of the two."""

    gain: float
    offset: float
    covariance: Floats

    def variance(self, signal: Floats) -> Floats:
        """The variance at a signal, of the same shape."""
        return self.gain * np.maximum(signal, 0.0) + self.offset


class Bins(NamedTuple):
    """Mean signal, robust variance and number of samples of neighbouring brightness."""

    signal: Floats
    variance: Floats
    samples: Integers


def first_bins(signal: Floats, noise: Floats) -> Bins:
    """Bins without a model of the variance: medians; `signal` ascends."""
    edges = signal[0] + (signal[-1] - signal[0]) * np.linspace(0.0, 1.0, _BINS + 1) ** 2  # finer in the dark
    starts, count = _thick(np.searchsorted(signal, edges[1:-1]), signal.size)
    medians = [np.median(noise[start : start + n]) / _MEDIAN for start, n in zip(starts, count, strict=True)]
    return Bins(np.add.reduceat(signal, starts) / count, np.array(medians), count)


def bins(signal: Floats, noise: Floats, line: Line) -> Bins:
    """Bins given a line: capped means of noise over its variance, so that a bin may span many brightnesses.

    They are of equal width in the square root of the variance, where noise is equally wide everywhere.
    """
    model = line.variance(signal)
    reach = np.sqrt(line.variance(signal[[0, -1]]))
    edges = (np.linspace(reach[0], reach[1], _BINS + 1) ** 2 - line.offset) / max(line.gain, 1e-30)
    starts, count = _thick(np.searchsorted(signal, edges[1:-1]), signal.size)
    excess = np.add.reduceat(np.minimum(noise / model, _CAP), starts) / (count * _CAPPED_MEAN)
    return Bins(np.add.reduceat(signal, starts) / count, excess * np.add.reduceat(model, starts) / count, count)


def _thick(cuts: Integers, size: int) -> tuple[Integers, Integers]:
    """First samples and counts of the bins between the cuts, thin ones joined to the one before."""
    starts = [0]
    for cut in cuts:
        if cut - starts[-1] >= _FEWEST and size - cut >= _FEWEST:
            starts.append(int(cut))
    return np.array(starts), np.diff([*starts, size])


def fit(points: Bins, floor: float) -> Line:
    """The line through the bins, its offset no less than `floor`; weights from the line itself, not from the bins.

    (A bin's own variance as its weight would favour those that came out low.) Huber weights over bins keep a textured
    brightness from bending it; where all scatter more than they should, the covariance grows with them.
    """
    signal = np.maximum(points.signal, 0.0)
    expected = np.maximum(points.variance, floor)
    trust = np.ones_like(expected)
    before = (-1.0, -1.0)
    for _ in range(_ITERATIONS):
        weight = trust * points.samples / (2.0 * OVERLAP * expected**2)
        gain, offset = _solve(signal, points.variance, weight, floor)
        expected = gain * signal + offset
        off = np.abs(points.variance - expected) / (expected * np.sqrt(2.0 * OVERLAP / points.samples))
        spread = max(1.0, float(np.median(off)) / 0.6745)
        trust = np.minimum(1.0, _HUBER * spread / np.maximum(off, 1e-9))
        if abs(gain - before[0]) <= _SETTLED * gain and abs(offset - before[1]) <= _SETTLED * offset:
            break
        before = gain, offset
    return Line(gain, offset, spread**2 * _covariance(signal, weight))


def _solve(signal: Floats, variance: Floats, weight: Floats, floor: float) -> tuple[float, float]:
    """Weighted least squares; on a bound where the free optimum lies beyond it."""
    sw, sx, sxx = weight.sum(), weight @ signal, weight @ signal**2
    sy, sxy = weight @ variance, weight @ (signal * variance)
    determinant = sw * sxx - sx * sx
    gain = (sw * sxy - sx * sy) / determinant if determinant > 1e-12 * sw * sxx else 0.0
    if gain <= 0.0:
        return 0.0, max(float(sy / sw), floor)
    offset = (sy - gain * sx) / sw
    if offset < floor:
        return max(float((sxy - floor * sx) / sxx), 0.0), floor
    return float(gain), float(offset)


def _covariance(signal: Floats, weight: Floats) -> Floats:
    columns = np.stack([signal, np.ones_like(signal)])
    return np.asarray(np.linalg.pinv((columns * weight) @ columns.T, hermitian=True))
