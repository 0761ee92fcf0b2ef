"""The sphere's three numbers from the limb: variable projection, robust, its covariance from the stretches' scatter.

Levels, slopes and the body's brightness of each stretch are linear and solved for (Golub & Pereyra 1973, with
Kaufman's derivative); centre, radius, blur, the light's direction and the coat are common to all. What texture
adds to the noise is measured in each stretch, inside and outside; samples that still do not fit count less (Student's
t). The covariance is a sandwich over whole stretches, whose samples share their errors (Liang & Zeger 1986).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, readonly

from .cone import angular_radius, depth_px
from .limb import BODY, COLUMNS, PRIOR, TABLE_STEP, Body, body, columns
from .stretches import Stretches

NUMBERS = 7  # centre x, y, radius (px), log blur (samples), the light's two tilts (rad), log of the coat's roughness
FREEDOM = 5.0  # of Student's t
SMALL = 0.02  # step for differences: samples, log blur, rad
BESIDE = 2.0  # samples from the limb
FAR = 0.98  # of a sample on one side of the limb, from which texture is measured there
LEAST_BLUR_PX = 0.41  # sd: a pixel's own area and a lens of 0.25 px, which none betters
MOST_BLUR = 4.0  # samples
COATS = (np.log(0.01), np.log(1.0))
MEANS = np.array([True, False, True, False, False, False])
LEAST = 0.003
SETTLED = 0.003  # samples
ACCURACY = 0.01  # samples, of the limb's model in its own numbers
CHANCE = 3.0  # sds of chi-square that are no misfit yet
LAGS = 2  # stretches whose errors may go together


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Where the fit stands: `numbers` as in NUMBERS, tilts taken into the light's direction."""

    numbers: Floats  # (NUMBERS,)
    light: Floats  # (3,), unit: x, y as in the picture, z to the camera

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def shape(self) -> Floats:
        """Centre x, y and radius (3,), px."""
        return self.numbers[:3]

    @property
    def blur(self) -> float:
        """Standard deviation of the limb's blur, samples."""
        return float(np.exp(self.numbers[3]))

    def moved(self, by: Floats, step_px: float) -> State:
        """The state after a step (NUMBERS,), in a picture of such samples."""
        there = self.displaced(by)
        return State(numbers=np.clip(there.numbers, *_bounds(step_px)), light=there.light)

    def displaced(self, by: Floats) -> State:
        """The state after a step, whatever its bounds."""
        light = self.light + by[4:6] @ tangents(self.light)
        numbers = self.numbers + np.where(np.isin(np.arange(NUMBERS), (4, 5)), 0.0, by)
        return State(numbers=numbers, light=light / np.linalg.norm(light))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limb:
    """A limb fitted: covariance of centre and radius (px^2), and what each stretch of it says."""

    state: State
    covariance: Floats  # (3, 3)
    seen_px: Floats  # (stretches,), sd with which each places the limb
    offset_px: Floats  # (stretches,), by how much each would move it outwards
    edge: NDArray[np.bool_]  # (stretches,), whether a limb explains it far better than a smooth curve
    moved_px: float

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Linear:
    """The stretches' linear numbers at a state."""

    design: Floats  # (groups, n, COLUMNS)
    weight: Floats  # (groups, n)
    normal: Floats  # (groups, COLUMNS, COLUMNS)
    coefficients: Floats  # (groups, COLUMNS)
    predicted: Floats  # (groups, n)


def tangents(light: Floats) -> Floats:
    """Two unit vectors (2, 3) across a direction."""
    helper = np.eye(3)[int(np.argmin(np.abs(light)))]
    across = np.cross(helper, light)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(light, across)])


def solve(samples: Stretches, camera: Camera, start: State, prior_sd: Floats, *, rounds: int) -> Limb:
    """Gauss-Newton from `start` with prior sds (NUMBERS,) about it."""
    state, weight, total = start, _first_weights(samples), np.zeros(NUMBERS)
    precision = 1.0 / prior_sd**2
    mix = _Mix.wide(samples)
    for _ in range(rounds):
        view = _View.of(samples, camera, state)
        weight = _weights(samples, _linear(samples, view.design, weight, mix))
        linear = _linear(samples, view.design, weight, mix)
        mix = mix.learnt(samples, linear)
        linear = _linear(samples, view.design, weight, mix)
        change = _change(samples, camera, state, view, linear)
        free = _free(linear, change)
        left = samples.value - linear.predicted
        score = np.einsum("gnk,gn->gk", change, weight * left)
        bend = np.einsum("gnk,gnj->gkj", change * weight[..., None], free)
        normal = bend.sum(axis=0) + np.diag(precision)
        move = _move(normal, score.sum(axis=0) - precision * total, state.numbers, samples.step_px)
        moved = state.moved(move * _share(move, samples.step_px), samples.step_px)
        step = moved.numbers - state.numbers
        step[4:6] = move[4:6] * _share(move, samples.step_px)
        state, total = moved, total + step
        if np.abs(step[:3]).max() < SETTLED * samples.step_px:
            break
    return _told(samples, state, view, linear, change, precision, float(np.abs(move[:3]).max()))


def _move(normal: Floats, slope: Floats, numbers: Floats, step_px: float) -> Floats:
    """Newton's step, numbers at a bound left there where it leads beyond."""
    low, high = _bounds(step_px)
    move = np.linalg.solve(normal, slope)
    loose = ~(((numbers <= low) & (move < 0)) | ((numbers >= high) & (move > 0)))
    move = np.zeros(NUMBERS)
    move[loose] = np.linalg.solve(normal[np.ix_(loose, loose)], slope[loose])
    return move


def _bounds(step_px: float) -> tuple[Floats, Floats]:
    """Between what the numbers stay."""
    low, high = np.full(NUMBERS, -np.inf), np.full(NUMBERS, np.inf)
    low[3], high[3] = np.log(LEAST_BLUR_PX / step_px), np.log(MOST_BLUR)
    low[6], high[6] = COATS
    return low, high


def _share(move: Floats, step_px: float) -> float:
    """How much of a step to go: a sample, and a third in the other numbers, at most."""
    return float(1.0 / max(1.0, np.abs(move[:3]).max() / step_px, np.abs(move[3:]).max() / 0.35))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _View:
    """The samples seen from a state: depth (samples) and azimuth, the body there, the design."""

    depth: Floats
    azimuth: Floats
    table: Body
    design: Floats

    @classmethod
    def of(cls, samples: Stretches, camera: Camera, state: State) -> _View:
        """Everything at a state."""
        depth = depth_px(camera, state.shape, samples.x_px, samples.y_px) / samples.step_px
        azimuth = np.arctan2(samples.y_px - state.shape[1], samples.x_px - state.shape[0])
        table = _table(samples, camera, state, depth)
        reflected = table.at(depth, azimuth)
        return cls(depth=depth, azimuth=azimuth, table=table, design=columns(depth, reflected, state.blur))


def _table(samples: Stretches, camera: Camera, state: State, depth: Floats) -> Body:
    radius = float(state.shape[2])
    return body(
        float(depth.min()) - 2 * TABLE_STEP,
        float(depth.max()) + 2 * TABLE_STEP,
        blur=state.blur,
        radius=radius / samples.step_px,
        light=state.light,
        coat=float(np.exp(state.numbers[6])),
        cone_rad=angular_radius(camera, radius),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Mix:
    """How the coefficients are spread over the stretches of a plane, in the ball's level: a mean and an sd of each."""

    mean: Floats  # (planes, COLUMNS)
    sd: Floats  # (planes, COLUMNS)

    @classmethod
    def wide(cls, samples: Stretches) -> _Mix:
        """Where nothing is known yet."""
        planes = len(samples.stretch) // samples.count
        return cls(mean=np.zeros((planes, COLUMNS)), sd=np.tile(PRIOR, (planes, 1)))

    def learnt(self, samples: Stretches, linear: _Linear) -> _Mix:
        """A step of expectation and maximisation (Dempster, Laird & Rubin 1977)."""
        shape = (-1, samples.count, COLUMNS)
        found = (linear.coefficients / samples.level).reshape(shape)
        spread2 = (np.diagonal(np.linalg.inv(linear.normal), axis1=1, axis2=2) / samples.level**2).reshape(shape)
        mean = np.where(MEANS, found.mean(axis=1), 0.0)
        sd = np.sqrt(np.mean((found - mean[:, None]) ** 2 + spread2, axis=1))
        return _Mix(mean=mean, sd=np.clip(sd, LEAST * PRIOR, PRIOR))


def _linear(samples: Stretches, design: Floats, weight: Floats, mix: _Mix) -> _Linear:
    """Coefficients of every stretch by weighted least squares about the planes' means."""
    weighted = design * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ design
    sd, mean = (np.repeat(v, samples.count, axis=0) * samples.level for v in (mix.sd, mix.mean))
    normal = normal + np.eye(COLUMNS) / sd[:, None, :] ** 2
    right = np.swapaxes(weighted, 1, 2) @ samples.value[..., None] + (mean / sd**2)[..., None]
    coefficients = np.linalg.solve(normal, right)
    return _Linear(
        design=design,
        weight=weight,
        normal=normal,
        coefficients=coefficients[..., 0],
        predicted=(design @ coefficients)[..., 0],
    )


def _first_weights(samples: Stretches) -> Floats:
    """Inverse variances (groups, n) by each stretch's median brightness."""
    smooth = np.maximum(np.median(samples.value, axis=1, keepdims=True), 0.0)
    return np.where(samples.there, 1.0 / (samples.gain * smooth + samples.read**2), 0.0)


def _weights(samples: Stretches, linear: _Linear) -> Floats:
    """Inverse variances (groups, n): noise at the expected brightness, texture on either side, Student's t."""
    variance = samples.gain * np.maximum(linear.predicted, 0.0) + samples.read**2
    left2 = (samples.value - linear.predicted) ** 2
    beyond = left2 - variance
    outside = linear.design[..., 0]
    for side in (outside, 1.0 - outside):
        far = samples.there & (side > FAR)
        typical = np.sum(beyond, axis=1, where=far) / np.maximum(np.count_nonzero(far, axis=1) - 2, 1)
        variance = variance + np.maximum(typical, 0.0)[:, None] * side
    return np.where(samples.there, (FREEDOM + 1) / (FREEDOM + left2 / variance) / variance, 0.0)


def _change(samples: Stretches, camera: Camera, state: State, view: _View, linear: _Linear) -> Floats:
    """Derivative (groups, n, NUMBERS) of the prediction, less what the linear coefficients take up."""
    amount = linear.coefficients[:, BODY, None]
    reflected = view.design[..., BODY]

    def predicted(design: Floats) -> Floats:
        return np.asarray((design @ linear.coefficients[..., None])[..., 0])

    deeper = columns(view.depth + SMALL, view.table.at(view.depth + SMALL, view.azimuth), state.blur)
    slope = (predicted(deeper) - linear.predicted) / SMALL
    parts = [slope * d for d in _moves(samples, camera, state)]
    for k in (3, 4, 5, 6):
        there = state.displaced(SMALL * np.eye(NUMBERS)[k])
        other = _table(samples, camera, there, view.depth).at(view.depth, view.azimuth)
        if k == 3:
            parts.append((predicted(columns(view.depth, other, there.blur)) - linear.predicted) / SMALL)
        else:
            parts.append(amount * (other - reflected) / SMALL)
    return np.stack(parts, axis=-1)


def _free(linear: _Linear, change: Floats) -> Floats:
    """The change less what the linear coefficients take up."""
    weighted = np.swapaxes(linear.design * linear.weight[..., None], 1, 2)
    return np.asarray(change - linear.design @ np.linalg.solve(linear.normal, weighted @ change))


def _moves(samples: Stretches, camera: Camera, state: State) -> list[Floats]:
    """By how much (samples per px) the depth of each sample changes with centre x, y and radius."""
    step = 0.01 * samples.step_px
    return [
        (
            depth_px(camera, state.shape + step * axis, samples.x_px, samples.y_px)
            - depth_px(camera, state.shape - step * axis, samples.x_px, samples.y_px)
        )
        / (2 * step * samples.step_px)
        for axis in np.eye(3)
    ]


def _told(
    samples: Stretches,
    state: State,
    view: _View,
    linear: _Linear,
    change: Floats,
    precision: Floats,
    moved_px: float,
) -> Limb:
    left = samples.value - linear.predicted
    score = np.einsum("gnk,gn->gk", change, linear.weight * left)
    free = _free(linear, change)
    bend = np.einsum("gnk,gnj->gkj", change * linear.weight[..., None], free)
    scores, bends = np.zeros((samples.count, NUMBERS)), np.zeros((samples.count, NUMBERS, NUMBERS))
    np.add.at(scores, samples.stretch, score)
    np.add.at(bends, samples.stretch, bend)
    outwards = np.maximum(bends[:, 2, 2], 1e-12)
    floor_px = np.hypot(ACCURACY * samples.step_px, _unexplained_px(samples, view, linear, free))
    return Limb(
        state=state,
        covariance=_covariance(scores, bends, precision)[:3, :3] + floor_px**2 * np.eye(3),
        seen_px=1.0 / np.sqrt(outwards),
        offset_px=scores[:, 2] / outwards,
        edge=_edges(samples, view, linear, samples.count),
        moved_px=moved_px,
    )


def _covariance(scores: Floats, bends: Floats, precision: Floats) -> Floats:
    """Covariance (NUMBERS, NUMBERS): the samples', stretched where the stretches' pulls exceed what it lets expect.

    The pulls are corrected for their own leverage (Bell & McCaffrey's jackknife) and may be correlated with their
    neighbours' (Newey & West 1987).
    """
    inverse = np.linalg.inv(bends.sum(axis=0) + np.diag(precision))
    pulls = np.linalg.solve(np.eye(NUMBERS) - bends @ inverse, scores[..., None])[..., 0]
    meat = pulls.T @ pulls + np.diag(precision)
    for lag in range(1, LAGS + 1):
        beside = pulls.T @ np.roll(pulls, lag, axis=0)
        meat = meat + (1 - lag / (LAGS + 1)) * (beside + beside.T)
    root = np.linalg.cholesky(inverse)
    size, axes = np.linalg.eigh(root.T @ meat @ root)
    return np.asarray(root @ (axes * np.maximum(size, 1.0)) @ axes.T @ root.T)


def _unexplained_px(samples: Stretches, view: _View, linear: _Linear, change: Floats) -> float:
    """The shift of the limb that would look as large as what the model leaves just inside, beyond the noise, px."""
    beside = samples.there & (np.abs(view.depth - BESIDE / 2) < BESIDE / 2)
    noise = samples.gain * np.maximum(linear.predicted, 0.0) + samples.read**2
    # a shift that is common to all would show in the residuals' mean over stretches, not only in their scatter
    beyond = np.sum((samples.value - linear.predicted) ** 2 / noise - 1.0, where=beside)
    left2 = beyond - CHANCE * np.sqrt(2.0 * np.count_nonzero(beside))
    return float(np.sqrt(max(left2, 0.0) / max(np.sum(change[..., 2] ** 2 / noise, where=beside), 1e-12)))


def _edges(samples: Stretches, view: _View, linear: _Linear, count: int) -> NDArray[np.bool_]:
    """Where a limb leaves less than half of what a cubic in depth leaves (the noise included)."""
    depth = view.depth / 8.0
    cubic = np.stack([np.ones_like(depth), depth, depth**2, depth**3], axis=-1)
    noise = np.where(samples.there, 1.0 / (samples.gain * np.maximum(linear.predicted, 0.0) + samples.read**2), 0.0)
    weighted = np.swapaxes(cubic * noise[..., None], 1, 2)
    normal = (
        weighted @ cubic
        + 1e-9 * np.trace(weighted @ cubic, axis1=1, axis2=2)[:, None, None] * np.eye(4)
        + 1e-12 * np.eye(4)
    )
    smooth = (cubic @ np.linalg.solve(normal, weighted @ samples.value[..., None]))[..., 0]
    left = np.zeros((2, count))
    for row, there in zip(left, (linear.predicted, smooth), strict=True):
        np.add.at(row, samples.stretch, np.sum(noise * (samples.value - there) ** 2, axis=1))
    return np.asarray(left[0] < 0.5 * left[1])
