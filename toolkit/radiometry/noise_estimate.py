"""Gain and read noise from one photograph, with their errors.

The squares of the finest local differences, regressed on the local mean, give variance = gain * signal + read^2 (the
model of Foi, Trimeche, Katkovnik & Egiazarian 2008). Places with structure are left out, and so is what clips.

Fine texture all over a background looks like noise. Where the sphere's disc is known, its smooth shading alone gives
the line; what lies around joins in, tile by tile, where it agrees with that line and is as loud in coarse differences
as in fine ones, which no texture is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.radiometry import noise_line
from toolkit.radiometry.highpass import OVERLAP, Residuals, residuals, tiles
from toolkit.radiometry.noise_line import Line
from toolkit.records import Floats, Noise, Plane, readonly

Disc = tuple[float, float, float]  # x, y, radius, pixels of the photograph
_MOST = 250_000  # samples a channel: errors are then far below what is asked, and 24 megapixels cost what one does
_FEWEST = 1000  # samples a channel below which nothing is left out for its structure
_SMALLEST = 8  # samples a side
_ROUNDS = 4
_STRUCTURED = 2.0  # `structure` over the noise's variance: about the 99 % point where there is none
_PILED_UP = 1e-3  # share of samples at a plane's minimum from which the minimum is taken for a clipped black
_NEAR_BLACK_SD = 4.0  # within so many deviations of a clipped black the noise is cut and not used
_KNOWN = 0.03  # relative: where the disc tells the variance so well, nothing else is asked
_WHITE = 0.05  # coarse and fine differences of a tile may differ by so much, beyond chance, to be noise alone
_CHANCE_SD = 3.0
_FEWEST_OF_TILE = 100
_SMOOTHEST = 0.25  # of each brightness, by structure: what the very first line is drawn through
_BINS_OF_SMOOTHEST = 64
_NOT_GAUSSIAN = 0.06  # error of the read noise per excess kurtosis of the noise: the robust means expect none
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
        return Noise(gain=self.gain, read=self.read, source="estimated", gain_sd=self.gain_sd, read_sd=self.read_sd)


def estimate(planes: Sequence[Plane], *, disc: Disc | None = None) -> NoiseEstimate:
    """The noise of an image's planes, each channel by itself; `disc` is where a smooth sphere is seen.

    The variance never falls below that of rounding: a twelfth of the squared step between stored numbers, or 1e-4 of
    the mean signal where the steps are finer (renders in floats), so that no sample's weight is infinite.
    """
    lines, counts = zip(*(_channel([p for p in planes if p.channel == c], disc) for c in range(3)), strict=True)
    gain, offset = np.array([line.gain for line in lines]), np.array([line.offset for line in lines])
    gain_sd, offset_sd = np.sqrt(np.array([np.diag(line.covariance) for line in lines])).T
    read = np.sqrt(offset)
    kurtosis = np.minimum(gain**2 / (4.0 * offset), 1.0)  # of Poisson and Gaussian noise together, where it is largest
    return NoiseEstimate(
        gain=gain,
        read=read,
        gain_sd=gain_sd,
        # the difference of roots holds at the bound too, where the slope is infinite
        read_sd=np.hypot(np.sqrt(offset + offset_sd) - read, _NOT_GAUSSIAN * kurtosis * read),
        samples=np.array(counts),
    )


def _channel(planes: list[Plane], disc: Disc | None) -> tuple[Line, int]:
    """The line of one channel's planes, and how many samples it rests on."""
    most = _MOST // len(planes)
    values = np.concatenate([tiles(plane.values, most) for plane in planes])
    flags = np.concatenate([tiles(plane.flags, most) for plane in planes])
    black, floor = _clipped_black(values), _rounding(values)
    if min(values.shape[1:]) < _SMALLEST:
        return Line(0.0, floor, np.full((2, 2), np.inf)), 0
    usable = (flags == 0) & (values > black)
    if disc is not None:
        inside = np.concatenate([tiles(_inside(plane, disc), most) for plane in planes])
        on, off = _sorted(residuals(values, usable & inside)), _sorted(residuals(values, usable & ~inside))
        if on.signal.size >= _FEWEST:
            line, _ = _line(on, black, floor, None)
            return _line(_joined(on, off, line), black, floor, line)
    data = _sorted(residuals(values, usable))
    if data.signal.size < _FEWEST:
        mean = float(data.noise.mean()) if data.noise.size else 0.0
        return Line(0.0, max(floor, mean), np.full((2, 2), np.inf)), data.signal.size
    return _line(data, black, floor, None)


def _inside(plane: Plane, disc: Disc) -> NDArray[np.bool_]:
    (x0, y0), step, (x, y, radius) = plane.origin_px, plane.step_px, disc
    row, column = np.ogrid[: plane.values.shape[0], : plane.values.shape[1]]
    return np.asarray((x0 + step * column - x) ** 2 + (y0 + step * row - y) ** 2 < radius**2)


def _sorted(data: Residuals) -> Residuals:
    """By brightness, in float64."""
    order = np.argsort(data.signal)
    signal, noise, structure = (np.asarray(part, float)[order] for part in (data.signal, data.noise, data.structure))
    return Residuals(signal, noise, structure, data.tile[order])


def _joined(on: Residuals, off: Residuals, line: Line) -> Residuals:
    """What lies on the disc, and those tiles around it that show noise alone, as loud as its line may have it.

    Only where that line knows the variance poorly: a texture too faint to be seen as one would still bend it.
    """
    count = np.maximum(np.bincount(off.tile), 1)
    signal, noise, structure = (np.bincount(off.tile, part) / count for part in (off.signal, off.noise, off.structure))
    chance = np.sqrt(2.0 * OVERLAP / count)
    white = np.abs(structure - noise) < (_WHITE + _CHANCE_SD * chance) * noise
    column = np.stack([np.maximum(signal, 0.0), np.ones_like(signal)])
    of_line, expected = np.einsum("in,ij,jn->n", column, line.covariance, column), line.variance(signal)
    agrees = np.abs(noise - expected) < _CHANCE_SD * np.sqrt(of_line + (chance * noise) ** 2)
    needed = of_line > (_KNOWN * expected) ** 2
    keep = (white & agrees & needed & (count >= _FEWEST_OF_TILE))[off.tile]
    return _sorted(Residuals(*(np.concatenate([mine, other[keep]]) for mine, other in zip(on, off, strict=True))))


def _line(data: Residuals, black: float, floor: float, line: Line | None) -> tuple[Line, int]:
    """The line in rounds: the variance tells which places have structure, the others give the variance anew."""
    if line is None:
        calm = _smoothest(data.structure)
        line = noise_line.fit(noise_line.first_bins(data.signal[calm], data.noise[calm]), floor)
    keep = np.ones(data.signal.size, bool)
    for _ in range(_ROUNDS):
        smooth = data.structure < _STRUCTURED * line.variance(data.signal)
        lit = data.signal > black + _NEAR_BLACK_SD * np.sqrt(line.variance(data.signal))
        keep = smooth & lit if np.count_nonzero(smooth & lit) >= _FEWEST else keep
        line = noise_line.fit(noise_line.bins(data.signal[keep], data.noise[keep], line), floor)
    return line, int(np.count_nonzero(keep))


def _smoothest(structure: Floats) -> NDArray[np.bool_]:
    """A quarter of the samples of each brightness: those with the least structure; `structure` by brightness."""
    parts = np.array_split(structure, _BINS_OF_SMOOTHEST)
    return np.concatenate([part <= np.quantile(part, _SMOOTHEST) for part in parts if part.size])


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
