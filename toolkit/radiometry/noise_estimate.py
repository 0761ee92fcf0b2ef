"""Gain and read noise from one photograph, with their errors.

The squares of the finest local differences, regressed on the local mean, give variance = gain * signal + read^2 (the
model of Foi, Trimeche, Katkovnik & Egiazarian 2008). Places with structure are left out, and so is what clips.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.radiometry import noise_line
from toolkit.radiometry.highpass import Residuals, residuals, tiles
from toolkit.radiometry.noise_line import Line
from toolkit.records import Floats, Noise, Plane, readonly

_MOST = 250_000  # samples a channel: errors are then far below what is asked, and 24 megapixels cost what one does
_FEWEST = 1000  # samples a channel below which nothing is left out for its structure
_SMALLEST = 8  # samples a side
_ROUNDS = 4
_STRUCTURED = 2.0  # `structure` over the noise's variance: about the 99 % point where there is none
_PILED_UP = 1e-3  # share of samples at a plane's minimum from which the minimum is taken for a clipped black
_NEAR_BLACK_SD = 4.0  # within so many deviations of a clipped black the noise is cut and not used
_FINEST_RELATIVE = 1e-4  # half floats, renders' usual form, are rounded to 1.4e-4 of their value (2^-11 / sqrt(12))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NoiseEstimate:
    """Gain and read noise of each channel (3,) in the image's units, their standard errors, and their samples."""

    gain: Floats
    read: Floats
    gain_sd: Floats
    read_sd: Floats
    samples: NDArray[np.integer[Any]]

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def noise(self) -> Noise:
        """The record that the fit takes."""
        return Noise(gain=self.gain, read=self.read, source="estimated")


def estimate(planes: Sequence[Plane]) -> NoiseEstimate:
    """The noise of an image's planes, each channel by itself.

    The variance never falls below that of rounding: a twelfth of the squared step between stored numbers, or 1e-4 of
    the mean signal where the steps are finer (renders in floats), so that no sample's weight is infinite.
    """
    lines, counts = zip(*(_channel([p for p in planes if p.channel == c]) for c in range(3)), strict=True)
    gain, offset = np.array([line.gain for line in lines]), np.array([line.offset for line in lines])
    gain_sd, offset_sd = np.sqrt(np.array([np.diag(line.covariance) for line in lines])).T
    return NoiseEstimate(
        gain=gain,
        read=np.sqrt(offset),
        gain_sd=gain_sd,
        read_sd=np.sqrt(offset + offset_sd) - np.sqrt(offset),  # holds at the bound too, where the slope is infinite
        samples=np.array(counts),
    )


def _channel(planes: list[Plane]) -> tuple[Line, int]:
    """The line of one channel's planes, and how many samples it rests on."""
    most = _MOST // len(planes)
    values = np.concatenate([tiles(plane.values, most) for plane in planes])
    flags = np.concatenate([tiles(plane.flags, most) for plane in planes])
    black, floor = _clipped_black(values), _rounding(values)
    if min(values.shape[1:]) < _SMALLEST:
        return Line(0.0, floor, np.full((2, 2), np.inf)), 0
    data = Residuals(*(part.astype(float) for part in residuals(values, (flags == 0) & (values > black))))
    if data.signal.size < _FEWEST:
        mean = float(data.noise.mean()) if data.noise.size else 0.0
        return Line(0.0, max(floor, mean), np.full((2, 2), np.inf)), data.signal.size
    order = np.argsort(data.signal)
    return _line(Residuals(*(part[order] for part in data)), black, floor)


def _line(data: Residuals, black: float, floor: float) -> tuple[Line, int]:
    """The line in rounds: the variance tells which places have structure, the others give the variance anew."""
    line = noise_line.fit(noise_line.first_bins(data.signal, data.noise), floor)
    keep = np.ones(data.signal.size, bool)
    for _ in range(_ROUNDS):
        smooth = data.structure < _STRUCTURED * line.variance(data.signal)
        lit = data.signal > black + _NEAR_BLACK_SD * np.sqrt(line.variance(data.signal))
        keep = smooth & lit if np.count_nonzero(smooth & lit) >= _FEWEST else keep
        line = noise_line.fit(noise_line.bins(data.signal[keep], data.noise[keep], line), floor)
    return line, int(np.count_nonzero(keep))


def _clipped_black(values: NDArray[np.float32]) -> float:
    """The level at which the dark noise is cut off; -inf where it is not."""
    lowest = values.min()
    piled_up = np.count_nonzero(values == lowest) > _PILED_UP * values.size
    return float(lowest) if piled_up else -np.inf


def _rounding(values: NDArray[np.float32]) -> float:
    """The variance that storing in steps adds, or that of half floats at the mean signal where steps are finer."""
    some = np.unique(values[:: max(len(values) // 16, 1)])
    step = float(np.median(np.diff(some[: some.size // 2 + 2]))) if some.size > 2 else 0.0
    relative = _FINEST_RELATIVE * float(np.abs(values).mean())
    return max(step**2 / 12.0, relative**2, 1e-20)
