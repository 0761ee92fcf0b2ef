"""The lamp's image on a mirror ball, measured: a disc of sky, mirrored by the ball, blurred by the camera.

The picture of a disc of given angular radius is computed on a grid finer than the pixels, blurred by a Gaussian, taken
together to pixels and fitted to every sample of every channel at its own place, with a sloping background. A clipped
sample says only that there is at least so much light: where the core is lost, the border of the clipped region and the
halo round it still tell the middle. Light, background and slope of each channel are solved for within each step
(variable projection; Golub & Pereyra 1973).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag, flagged
from toolkit.records import Camera, Floats, LinearImage, Sphere, readonly

from .chrome_spot import Spot
from .sphere import surface

BLUR_PX, BLUR_SPREAD = 0.9, 0.8  # what cameras' blur is about, and the sd of its logarithm
LEAST_BLUR_PX, MOST_BLUR_PX = 0.2, 8.0
LARGEST_LAMP_RAD = 0.6
FINEST, GRID = 5, 160  # parts of a pixel's side, and points of the fine grid's side, at most
MISFIT, BLOOM_MISFIT = 0.01, 0.1  # of the lamp's light in a sample: lamps are no perfect discs; beside clipped ones
ROUNDS = 2  # of weights, which come from the model
# what the model leaves, measured on renders, with and without clipping: of the place in pixels, of the radius in blurs
PLACE_FLOOR_PX, RADIUS_FLOOR = (0.01, 0.03), (0.25, 0.8)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LampImage:
    """Where the image of the lamp's middle lies, the lamp's angular radius, and the camera's blur."""

    place_px: tuple[float, float]
    covariance_px2: Floats  # (2, 2)
    lamp_radius_rad: float
    radius_relative_sd: float
    blur_px: float
    clipped: tuple[bool, bool, bool]  # by channel, within the image's middle
    chi2_reduced: float
    rival: bool

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Window:
    """Pixels round a spot: what a mirror shows at each point of the finer grid, and the samples among the pixels."""

    corner: tuple[int, int]  # x, y of the first pixel
    side: int
    parts: int
    sky: Floats  # (n, n, 3)
    pace: Floats  # (n, n), rad between neighbouring points
    channel: NDArray[np.intp]  # (samples,) and so on
    pixel: NDArray[np.intp]
    value: Floats
    least: NDArray[np.bool_]  # clipped: at least so much
    bloom: NDArray[np.bool_]


def fit_lamp_image(image: LinearImage, spot: Spot, *, sphere: Sphere, camera: Camera) -> LampImage:
    """The lamp's image near a spot, to a small part of a pixel; raises BadInputError where it is no mirror's image."""
    from scipy.optimize import least_squares

    window = _window(image, spot, sphere, camera)
    start = _start(window, spot, sphere, camera)
    sd = _sd(image, window, window.value, np.zeros(len(window.value)))
    low = [spot.x_px - window.side / 2, spot.y_px - window.side / 2, np.log(_finest(window)), np.log(LEAST_BLUR_PX)]
    high = [spot.x_px + window.side / 2, spot.y_px + window.side / 2, np.log(LARGEST_LAMP_RAD), np.log(MOST_BLUR_PX)]
    for _ in range(ROUNDS):
        fit: Any = least_squares(
            _residual,
            np.clip(start, np.add(low, 1e-6), np.subtract(high, 1e-6)),
            args=(window, sphere, camera, sd),
            bounds=(low, high),
            x_scale=[0.1, 0.1, 0.1, 0.1],
            diff_step=[1e-6, 1e-6, 1e-4, 1e-3],
            xtol=1e-7,
            ftol=1e-9,
            max_nfev=25,
        )
        start = fit.x
        model, lamp = _model(start, window, sphere, camera, sd)
        sd = _sd(image, window, model, lamp)
    _refuse_soft(float(np.exp(start[3])))
    return _measured(fit, window, spot, model, lamp)


def _refuse_soft(blur_px: float) -> None:
    """A rough surface blurs the lamp far more than a camera does, and not evenly: its place would be off by degrees."""
    if blur_px > 0.99 * MOST_BLUR_PX:
        raise BadInputError(
            f"the highlight is soft over more than {MOST_BLUR_PX:.0f} px: the ball is glossy, not a mirror, or out of "
            "focus; expected a polished mirror ball in focus, or one smaller in the frame"
        )


def _measured(fit: Any, window: _Window, spot: Spot, model: Floats, lamp: Floats) -> LampImage:  # noqa: ANN401  # scipy's result
    residual = fit.fun[:-1]
    informed = int(np.sum(~window.least | (residual != 0.0)))
    chi2 = float(residual @ residual) / max(informed - 16, 1)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * max(chi2, 1.0)
    core = lamp > 0.3 * lamp.max()
    red, green, blue = (bool((window.least & core)[window.channel == c].any()) for c in range(3))
    cut = int(red or green or blue)
    floor = RADIUS_FLOOR[cut] * np.exp(fit.x[3] - fit.x[2]) * _finest(window) * window.parts
    return LampImage(
        place_px=(float(fit.x[0]), float(fit.x[1])),
        covariance_px2=covariance[:2, :2] + PLACE_FLOOR_PX[cut] ** 2 * np.eye(2),
        lamp_radius_rad=float(np.exp(fit.x[2])),
        radius_relative_sd=float(np.hypot(np.sqrt(covariance[2, 2]), floor)),
        blur_px=float(np.exp(fit.x[3])),
        clipped=(red, green, blue),
        chi2_reduced=chi2,
        rival=spot.rival,
    )


def _window(image: LinearImage, spot: Spot, sphere: Sphere, camera: Camera) -> _Window:
    half = int(np.ceil(1.6 * spot.radius_px + 6))
    corner = (round(spot.x_px) - half, round(spot.y_px) - half)
    side = 2 * half + 1
    parts = max(min(FINEST, GRID // side), 1)
    fine = (np.arange(side * parts) + 0.5) / parts - 0.5
    x, y = np.meshgrid(corner[0] + fine, corner[1] + fine)
    seen = surface(camera, sphere, x.ravel(), y.ravel())
    cosine = np.einsum("ni,ni->n", seen.normal, seen.view)[:, None]
    sky = np.where(seen.on_sphere[:, None], 2 * cosine * seen.normal - seen.view, 0.0).reshape(*x.shape, 3)
    pace = np.sqrt(sum(np.sum(np.square(np.gradient(sky, axis=axis)), axis=-1) for axis in (0, 1)) / 2)
    return _Window(
        corner=corner, side=side, parts=parts, sky=sky, pace=np.maximum(pace, 1e-9), **_samples(image, corner, side)
    )


def _samples(image: LinearImage, corner: tuple[int, int], side: int) -> dict[str, Any]:
    """All samples of all planes within the window: channel, pixel's number, value, clipped, beside clipped."""
    found: list[tuple[Any, ...]] = []
    for plane in image.planes:
        row, column = np.mgrid[: plane.values.shape[0], : plane.values.shape[1]]
        x = (plane.origin_px[0] + plane.step_px * column - corner[0]).astype(int)
        y = (plane.origin_px[1] + plane.step_px * row - corner[1]).astype(int)
        use = (x >= 0) & (y >= 0) & (x < side) & (y < side) & ~flagged(plane.flags, SampleFlag.INVALID)
        flags, values = plane.flags[use], plane.values[use].astype(float)
        least = flagged(flags, SampleFlag.CLIPPED) & (values > 0.0)
        channel = np.full(len(values), plane.channel)
        found.append((channel, (y * side + x)[use], values, least, flagged(flags, SampleFlag.BLOOM)))
    names = ("channel", "pixel", "value", "least", "bloom")
    return dict(zip(names, map(np.concatenate, zip(*found, strict=True)), strict=True))


def _start(window: _Window, spot: Spot, sphere: Sphere, camera: Camera) -> Floats:
    """Place, log radius, log blur: the radius is that of the spot, less the blur."""
    middle = window.pace[window.pace.shape[0] // 2, window.pace.shape[1] // 2] * window.parts
    radius_px = np.sqrt(max(spot.radius_px**2 - 2 * BLUR_PX**2, 0.3))
    return np.array([spot.x_px, spot.y_px, np.log(np.clip(radius_px * middle, _finest(window), 0.5)), np.log(BLUR_PX)])


def _finest(window: _Window) -> float:
    """The least angular radius that the grid shows."""
    return float(window.pace[window.pace.shape[0] // 2, window.pace.shape[1] // 2])


def _picture(p: Floats, window: _Window, sphere: Sphere, camera: Camera) -> Floats:
    """The blurred disc on the window's pixels (side^2,), its greatest value 1."""
    from scipy.ndimage import gaussian_filter

    seen = surface(camera, sphere, p[:1], p[1:2])
    middle = 2 * np.sum(seen.normal * seen.view) * seen.normal[0] - seen.view[0]
    chord = np.linalg.norm(window.sky - middle, axis=-1)
    away = 2 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
    disc = np.clip(0.5 + (np.exp(p[2]) - away) / window.pace, 0.0, 1.0)
    blurred = gaussian_filter(disc, float(np.exp(p[3])) * window.parts, mode="constant", truncate=4.0)
    pixels = blurred.reshape(window.side, window.parts, window.side, window.parts).mean(axis=(1, 3))
    return np.asarray(pixels.ravel() / max(float(pixels.max()), 1e-12))


def _residual(p: Floats, window: _Window, sphere: Sphere, camera: Camera, sd: Floats) -> Floats:
    """Weighted misfit of each sample, and of the blur from what cameras' blur is about."""
    model, _ = _model(p, window, sphere, camera, sd)
    misfit = (model - window.value) / sd
    misfit = np.where(window.least, np.minimum(misfit, 0.0), misfit)
    return np.append(misfit, (p[3] - np.log(BLUR_PX)) / BLUR_SPREAD)


def _model(p: Floats, window: _Window, sphere: Sphere, camera: Camera, sd: Floats) -> tuple[Floats, Floats]:
    """All samples as the model has them, and the lamp's part of it."""
    shape = _picture(p, window, sphere, camera)[window.pixel]
    across = (window.pixel % window.side) / window.side - 0.5
    down = (window.pixel // window.side) / window.side - 0.5
    columns = np.stack([shape, np.ones_like(shape), across, down], axis=1)
    model, lamp = np.zeros(len(shape)), np.zeros(len(shape))
    for channel in range(3):
        mine = window.channel == channel
        numbers = _solved(columns[mine], window.value[mine], window.least[mine], sd[mine])
        model[mine], lamp[mine] = columns[mine] @ numbers, columns[mine, 0] * numbers[0]
    return model, lamp


def _solved(columns: Floats, value: Floats, least: NDArray[np.bool_], sd: Floats) -> Floats:
    """Linear numbers (4,) by least squares; a clipped sample counts only where the model stays below it."""
    weighted, target = columns / sd[:, None], value / sd
    counts = np.ones(len(value), bool)
    for _ in range(8):
        a = weighted[counts]
        ridge = 1e-9 * np.trace(a.T @ a) * np.eye(4) / 4
        numbers = np.linalg.solve(a.T @ a + ridge, a.T @ target[counts])
        now = ~least | (columns @ numbers < value)
        if np.array_equal(now, counts):
            break
        counts = now
    return np.asarray(numbers)


def _sd(image: LinearImage, window: _Window, signal: Floats, lamp: Floats) -> Floats:
    """Standard deviations: the camera's noise at the model's signal, and what a lamp is not quite a disc."""
    sd = np.empty(len(signal))
    for channel in range(3):
        mine = window.channel == channel
        misfit = np.where(window.bloom[mine] & ~window.least[mine], BLOOM_MISFIT, MISFIT)
        peak = np.minimum(lamp[mine], image.white if np.isfinite(image.white) else np.inf)
        sd[mine] = np.sqrt(image.noise.variance(signal[mine], channel) + np.square(misfit * np.maximum(peak, 0.0)))
    return np.maximum(sd, 1e-6 * max(float(np.abs(window.value).max()), 1e-12))
