"""What separation starts from: a picture with its noise, and the means of its blocks, where the noise is small."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.records import Floats, Noise, readonly

Mask = NDArray[np.bool_]
BLOOM_WEIGHT = 1 / 9  # a pixel beside a clipped one counts as one of three times the noise
FEWEST = 64  # pixels with all channels usable, below which no cluster is seen
MOST_BLOCKS = 12000  # more cost time and tell no more
FEWEST_ACROSS = 24  # blocks across the sphere, so that highlight and matte do not share them all
WANTED_NOISE = 3e-5  # of the brightest block: less no longer moves the matte line's one-sided fit
LOUDEST = 1e12  # variance, beyond which a sample tells nothing whatever its size
BAND = 1 << 16  # pixels at a time
ROUNDING = 1e-7  # of the brightest sample: what float32 storage adds to any noise


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """A picture ready to be separated. Samples that are not finite or off the sphere are 0, and not usable.

    Each channel of an array lies together in memory: numpy is slow along a last axis of three.
    """

    values: Floats  # (h, w, 3)
    variance: Floats  # (h, w, 3) or (3,)
    usable: Mask  # (h, w, 3)
    weight: Floats  # (h, w): 1, less beside clipped pixels, 0 where a channel is missing or off the sphere
    on_sphere: Mask  # (h, w)
    unit: float  # radiance of 1 in `values`: 1, or a power of two where the picture's own units are extreme

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Blocks:
    """Means of square blocks: still mixtures of the same two colours, with less noise."""

    colour: Floats  # (n, 3)
    variance: Floats  # (n, 3)
    x: Floats  # (n,) centre of the block's own pixels, in pixels of the picture
    y: Floats
    weight: Floats  # (n,) how many pixels' worth
    size: int  # pixels along a side

    def __post_init__(self) -> None:
        readonly(self)


def samples(
    picture: Floats,
    *,
    variance: Floats | Noise,
    usable: Mask | None = None,
    bloom: Mask | None = None,
    on_sphere: Mask | None = None,
) -> Samples:
    """Check what came in and bring it into one form.

    `picture` (h, w, 3) linear radiance; `variance` (h, w, 3), (3,), or a Noise whose variance is taken at the local
    mean; `usable` (h, w, 3), False where clipped; `bloom` and `on_sphere` (h, w).
    Raises BadInputError for other shapes, no signal, or too few pixels with every channel usable.
    """
    picture = np.asarray(picture)
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise BadInputError(f"picture has shape {picture.shape}; separation by colour needs (h, w, 3): a colour image")
    shape = picture.shape
    on, told = _mask("on_sphere", on_sphere, shape[:2]), _mask("usable", usable, shape)
    values, good = np.empty((3, *shape[:2]), np.result_type(picture, np.float32)), np.empty((3, *shape[:2]), bool)
    for c in range(3):
        there = np.isfinite(picture[..., c]) & on
        values[c] = picture[..., c]
        np.copyto(values[c], 0, where=~there)
        np.logical_and(there, told[..., c], out=good[c])
    whole = good[0] & good[1] & good[2]
    values, good = np.moveaxis(values, 0, -1), np.moveaxis(good, 0, -1)
    _refuse_empty(values, whole)
    weight = whole.astype(values.dtype)
    if bloom is not None:
        np.multiply(weight, BLOOM_WEIGHT, out=weight, where=_mask("bloom", bloom, shape[:2]))
    noise, unit = _variance(variance, values, good), unit_of(values)
    if unit != 1.0:
        values, noise = values / unit, noise / unit / unit
    np.clip(noise, 0.0, LOUDEST, out=noise)
    noise += noise.dtype.type(ROUNDING**2 * _largest(values) ** 2)
    return Samples(values=values, variance=noise, usable=good, weight=weight, on_sphere=on, unit=unit)


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))


def unit_of(values: Floats) -> float:
    """1 for any sensible picture; else the power of two that makes it one, so that no product over- or underflows."""
    largest = _largest(values)
    return 1.0 if 1e-6 < largest < 1e6 or largest == 0 else float(2.0 ** np.round(np.log2(largest)))


def _mask(name: str, mask: Mask | None, shape: tuple[int, ...]) -> Mask:
    if mask is None:
        return np.ones(shape, bool)
    mask = np.asarray(mask)
    if mask.shape != shape:
        raise BadInputError(f"{name} has shape {mask.shape}; expected {shape}, as the picture")
    return mask.astype(bool, copy=False)


def _refuse_empty(values: Floats, whole: Mask) -> None:
    full = int(np.count_nonzero(whole))
    if full < FEWEST:
        raise BadInputError(
            f"{full} pixels have all three channels usable; separation by colour needs {FEWEST}: "
            "expose less where they clip, or check the mask"
        )
    if values.max() <= 0:
        raise BadInputError("the picture holds no light at all; expected a lit sphere: check exposure and mask")


def _variance(variance: Floats | Noise, values: Floats, good: Mask) -> Floats:
    """A new array (h, w, 3) or (3,) of the samples' variances."""
    if isinstance(variance, Noise):
        noise = np.empty((3, *values.shape[:2]), values.dtype)
        for rows in _bands(values.shape):
            mean = local_mean(values, good, rows)
            for c in range(3):
                noise[c, rows] = variance.variance(mean[..., c], c)
        return np.moveaxis(noise, 0, -1)
    found = np.asarray(variance, float)
    if found.shape not in ((3,), values.shape):
        raise BadInputError(f"variance has shape {found.shape}; expected (3,) or {values.shape}")
    wrong = ~(np.isfinite(found) & (found >= 0))
    if np.any(wrong & (good if found.ndim == 3 else True)):
        raise BadInputError("variance holds negative or non-finite numbers; expected each sample's sd squared")
    return np.where(wrong, 0.0, found)


def _bands(shape: tuple[int, ...]) -> Iterator[slice]:
    """Lines of a picture (h, w, ...), as many at a time as stay in the processor's cache."""
    height, width = shape[:2]
    many = max(BAND // width, 1)
    return (slice(start, min(start + many, height)) for start in range(0, height, many))


def local_mean(values: Floats, good: Mask, rows: slice, radius: int = 2) -> Floats:
    """Mean (n, w, 3), on some lines, of the usable samples within `radius` pixels: what a variance is taken at."""
    above = min(radius, rows.start)
    around, inner = slice(rows.start - above, rows.stop + radius), slice(above, above + rows.stop - rows.start)
    found, before = [], None
    for c in range(3):
        usable = good[around, :, c].astype(values.dtype)
        if before is None or not np.array_equal(usable, before):
            before, count = usable, np.maximum(_box(usable, radius)[inner], 1.0)
        found.append(_box(values[around, :, c] * usable, radius)[inner] / count)
    return np.moveaxis(np.stack(found), 0, -1)


def _box(values: Floats, radius: int) -> Floats:
    """Sums over squares of 2 radius + 1 pixels, the outside counted as 0."""
    import cv2  # slow to import, and only a Noise needs it

    side = 2 * radius + 1
    return np.asarray(cv2.boxFilter(values, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT))


def block_size(picture: Samples, louder: float = 1.0) -> int:
    """As small as `MOST_BLOCKS` allows and as large as the noise asks, but never so large as to hide the highlight.

    `louder` is the noise found over the noise told.
    """
    full = np.flatnonzero(picture.weight > 0)  # of truth values: numpy is slow to find floats
    count = len(full)
    some = full[:: max(count // 4096, 1)]
    row, column = np.unravel_index(some, picture.weight.shape)
    bright = float(np.quantile(picture.values[row, column].max(axis=1), 0.98))
    variance = picture.variance if picture.variance.ndim == 1 else picture.variance[row, column]
    noise = louder * float(np.sqrt(variance.mean()))
    for_time = np.ceil(np.sqrt(count / MOST_BLOCKS))
    for_noise = np.ceil(noise / max(WANTED_NOISE * bright, 1e-300))
    return int(max(for_time, min(for_noise, np.sqrt(count) / FEWEST_ACROSS), 1))


def blocks(picture: Samples, size: int) -> Blocks:
    """Weighted means of squares of `size` pixels that hold at least a quarter of their pixels."""
    weight, variance = picture.weight, picture.variance
    x, y = (np.arange(n, dtype=weight.dtype) for n in weight.shape[::-1])
    total = _block_sums(weight, 1.0, size)
    held = total >= 0.25 * size * size
    total = total[held]

    def means(layer: Floats) -> Floats:
        return _block_sums(weight, layer, size)[held] / total

    colour = np.stack([means(picture.values[..., c]) for c in range(3)], axis=-1)
    if variance.ndim == 3:  # weight w stands for a variance of v / w
        variance = np.stack([means(variance[..., c]) for c in range(3)], axis=-1)
    return Blocks(
        colour=colour,
        variance=variance / total[:, None],
        x=means(x),
        y=means(y[:, None]),
        weight=total,
        size=size,
    )


def _block_sums(weight: Floats, layer: float | Floats, size: int) -> Floats:
    """Sums (n,) of weight (h, w) x layer over squares, the edges filled up with nothing, in float64."""
    height, width = weight.shape
    layer = np.broadcast_to(np.asarray(layer, weight.dtype), weight.shape)
    lines = np.zeros((-(-height // size), -(-width // size) * size), weight.dtype)
    for line, start in zip(lines, range(0, height, size), strict=True):
        rows = slice(start, start + size)
        np.einsum("yx,yx->x", weight[rows], layer[rows], out=line[:width])
    return np.asarray(lines.reshape(len(lines), -1, size).sum(axis=2).ravel(), float)
