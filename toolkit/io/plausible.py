"""Whether decoded numbers can be a photograph: files that decode to nothing or to garbage are refused.

Decoders accept much: a raw cut short may come back as zeros or as whatever the memory held before, a scanner's file as
a camera's. Each test below names a property that every photograph has and that such numbers lack.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.io.decoded import Decoded

_SMALLEST = 8  # pixels a side
_SOME = 250_000  # samples looked at: the properties are of the whole
_FEWEST_BITS = 0.25  # a sample: a sensor's noise alone does not pack into less, lossy DNGs take about one
_ABOVE_WHITE = 0.02  # of the range: more than saturation scatters
_LOOSE = 0.1  # correlation of neighbours of one colour; photographs, noisy ones too, have over 0.5
_WIDE = 0.05  # of the range: the deviation from which uncorrelated samples are no dark frame's noise
_EMPTY_ROWS = 0.02  # of the height


def check(decoded: Decoded, file_bytes: int) -> None:
    """Raise BadInputError where the numbers cannot be a photograph."""
    values = decoded.values
    height, width = values.shape[:2]
    if min(height, width) < _SMALLEST:
        raise BadInputError(f"it decodes to {width} x {height} pixels; a photograph has at least {_SMALLEST} a side")
    some = _sample(values)
    if _constant(some) and _constant(values):
        raise BadInputError(_same_everywhere(decoded))
    _check_channels(decoded, some)
    if values.dtype.kind == "f":
        return
    if decoded.format == "raw":
        _check_bits(values.size, file_bytes)
        _check_levels(decoded, some)
        _check_end(decoded)
    _check_neighbours(decoded)


def _sample(values: NDArray[Any]) -> NDArray[Any]:
    """About `_SOME` samples in whole rows, from all over the image."""
    step = max(values.size // _SOME, 1) | 1  # odd: both kinds of row of a mosaic
    return values[::step]


def _constant(values: NDArray[Any]) -> bool:
    """Whether all finite samples are equal, or none is finite."""
    if values.dtype.kind == "f":
        values = values[np.isfinite(values)]
    return values.size == 0 or bool(values.min() == values.max())


def _same_everywhere(decoded: Decoded) -> str:
    if not np.isfinite(decoded.values).any():
        return "it decodes to nothing: no sample is a finite number; render or export it again"
    level, white = float(np.max(decoded.values)), float(np.min(decoded.white))
    if level >= 0.99 * white:
        return f"every sample is at {level:g}, its white level; expected a photograph not all clipped: expose shorter"
    return "it decodes to nothing: every sample is the same; copy it from the camera again"


def _check_channels(decoded: Decoded, some: NDArray[Any]) -> None:
    """Three colours are measured only where each of them varies."""
    colours = range(3) if decoded.cfa is None else ((0, 0), (0, 1), (1, 0), (1, 1))
    for place in colours:
        if _constant(_of_one_colour(some, place)) and _constant(_of_one_colour(decoded.values, place)):
            raise BadInputError(
                "one of its channels is the same everywhere; three colours are needed: use a colour camera"
            )


def _of_one_colour(values: NDArray[Any], place: int | tuple[int, int]) -> NDArray[Any]:
    """A channel of an RGB image, or one of a mosaic's four colours; of rows thinned by an odd step too."""
    return values[..., place] if isinstance(place, int) else values[place[0] :: 2, place[1] :: 2]


def _check_bits(samples: int, file_bytes: int) -> None:
    bits = 8.0 * file_bytes / samples
    if bits < _FEWEST_BITS:
        raise BadInputError(
            f"{file_bytes} bytes for {samples / 1e6:.1f} million samples; no camera packs its noise so tightly: the "
            "file is cut short or damaged: copy it from the camera again"
        )


def _check_levels(decoded: Decoded, some: NDArray[Any]) -> None:
    white, black = float(np.max(decoded.white)), float(np.min(decoded.black))
    middle = float(np.median(some))
    if not 0.0 <= black < white:
        raise BadInputError(f"its black level {black:g} is not below its white level {white:g}; the file is damaged")
    if middle > white + _ABOVE_WHITE * (white - black):
        raise BadInputError(
            f"half of its samples lie above {middle:g}, its white level is {white:g}; the raw is damaged or of an "
            "unsupported kind: export it as DNG, or 16-bit TIFF"
        )


def _check_end(decoded: Decoded) -> None:
    """A raw cut short ends in rows of zeros, which a sensor with a black level above zero never gives."""
    values = decoded.values
    rows = max(int(_EMPTY_ROWS * values.shape[0]), 4)
    borders = (values[:rows], values[-rows:], values[:, :rows], values[:, -rows:])  # it may have been turned
    if np.min(decoded.black) > 0 and any(not border.any() for border in borders):
        raise BadInputError("a part of it decodes to zeros; the file is cut short: copy it from the camera again")


def _check_neighbours(decoded: Decoded) -> None:
    """Next samples of one colour belong together; numbers that do not are a decoder's misunderstanding."""
    values = decoded.values
    spacing = 2 if decoded.cfa is not None else 1
    step = max(values.size // _SOME, 1)
    rows = values[::step].astype(float)
    spread = float(rows.std())
    along = _correlation(rows[:, :-spacing], rows[:, spacing:])
    across = _correlation(*(part.astype(float) for part in (values[:-spacing:step], values[spacing::step])))
    scale = float(np.max(decoded.white) - np.min(decoded.black))
    if spread > _WIDE * scale and max(along, across) < _LOOSE:
        raise BadInputError(
            f"its neighbouring samples are unrelated (correlation {max(along, across):.2f}); it decodes to garbage: "
            "export it as DNG, or 16-bit TIFF"
        )


def _correlation(first: NDArray[Any], second: NDArray[Any]) -> float:
    one, other = ((each - each.mean()).ravel() for each in (first, second))
    both = float(np.sqrt((one @ one) * (other @ other)))
    return float(one @ other) / both if both > 0 else 1.0
