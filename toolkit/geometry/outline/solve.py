"""The sphere's three numbers from the limb: variable projection, robust.

Levels, slopes and the body's brightness of each stretch are linear and solved for (Golub & Pereyra 1973, with
Kaufman's derivative); centre, radius, blur, the light's direction and the coat are common to all. What texture
adds to the noise is measured in each stretch, inside and outside; samples that still do not fit count less (Student's
t). What each stretch pulls at the solution goes to `errors`, which says how well all is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Camera, Floats, readonly

from .cone import angular_radius, depth_px
from .errors import Pulls
from .limb import BODY, TABLE_STEP, Body, body, columns
from .linear import Linear, Mix, first_weights, solved, texture, weights
from .state import MATTE, NUMBERS, State, bounds, roughness
from .stretches import Stretches

SMALL = 0.02  # step for differences: samples, log blur, rad
BESIDE = 2.0  # samples from the limb
CHANCE = 3.0  # sds of a median that are no misfit yet


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limb:
    """A limb fitted, and what each stretch of it says."""

    state: State
    pulls: Pulls
    seen_px: Floats  # (stretches,), sd with which each places the limb
    offset_px: Floats  # (stretches,), by how much each would move it outwards
    edge: NDArray[np.bool_]  # (stretches,), whether a limb explains it far better than a smooth curve
    moved_px: float  # in the last step

    def __post_init__(self) -> None:
        readonly(self)


def solve(samples: Stretches, camera: Camera, start: State, prior_sd: Floats, *, rounds: int, settled: float) -> Limb:
    """Gauss-Newton from `start` with prior sds (NUMBERS,) about it, until steps are below `settled` samples."""
    state, weight, total = start, first_weights(samples), np.zeros(NUMBERS)
    precision = 1.0 / prior_sd**2
    mix = Mix.wide(samples)
    for _ in range(rounds):
        view = _View.of(samples, camera, state)
        weight = weights(samples, solved(samples, view.design, weight, mix))
        mix = mix.learnt(samples, solved(samples, view.design, weight, mix))
        linear = solved(samples, view.design, weight, mix)
        change = _change(samples, camera, state, view, linear)
        free = _free(linear, change)
        left = samples.value - linear.predicted
        score = np.einsum("gnk,gn->gk", change, weight * left)
        bend = np.einsum("gnk,gnj->gkj", change * weight[..., None], free)
        normal = bend.sum(axis=0) + np.diag(precision)
        move, loose = _move(normal, score.sum(axis=0) - precision * total, state.numbers, samples.step_px)
        moved = state.moved(move * _share(move, samples.step_px), samples.step_px)
        step = moved.numbers - state.numbers
        step[4:6] = move[4:6] * _share(move, samples.step_px)
        state, total = moved, total + step
        if np.abs(step[:3]).max() < settled * samples.step_px:
            break
    return _told(samples, state, view, linear, change, precision, loose, float(np.abs(move[:3]).max()))


def _move(normal: Floats, slope: Floats, numbers: Floats, step_px: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Newton's step, numbers at a bound left there where it leads beyond, and which are not."""
    low, high = bounds(step_px)
    move = np.linalg.solve(normal, slope)
    loose = ~(((numbers <= low) & (move < 0)) | ((numbers >= high) & (move > 0)))
    move = np.zeros(NUMBERS)
    move[loose] = np.linalg.solve(normal[np.ix_(loose, loose)], slope[loose])
    return move, loose


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
        depth -= state.blur**2 * samples.step_px / (2.0 * state.shape[2])  # by blur (Verbeek & van Vliet 1994)
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
        coat=roughness(float(state.numbers[MATTE])),
        cone_rad=angular_radius(camera, radius),
    )


def _change(samples: Stretches, camera: Camera, state: State, view: _View, linear: Linear) -> Floats:
    """Derivative (groups, n, NUMBERS) of the prediction, less what the linear coefficients take up."""
    amount = linear.coefficients[:, BODY, None]
    reflected = view.design[..., BODY]

    def predicted(design: Floats) -> Floats:
        return np.asarray((design @ linear.coefficients[..., None])[..., 0])

    deeper = columns(view.depth + SMALL, view.table.at(view.depth + SMALL, view.azimuth), state.blur)
    slope = (predicted(deeper) - linear.predicted) / SMALL
    parts = [slope * d for d in _moves(samples, camera, state)]
    for k in (3, 4, 5, MATTE):
        there = state.displaced(SMALL * np.eye(NUMBERS)[k])
        other = _table(samples, camera, there, view.depth).at(view.depth, view.azimuth)
        if k == 3:
            parts.append((predicted(columns(view.depth, other, there.blur)) - linear.predicted) / SMALL)
        else:
            parts.append(amount * (other - reflected) / SMALL)
    return np.stack(parts, axis=-1)


def _free(linear: Linear, change: Floats) -> Floats:
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
    linear: Linear,
    change: Floats,
    precision: Floats,
    loose: NDArray[np.bool_],
    moved_px: float,
) -> Limb:
    score = np.einsum("gnk,gn->gk", change, linear.weight * (samples.value - linear.predicted))
    free = _free(linear, change)
    bend = np.einsum("gnk,gnj->gkj", change * linear.weight[..., None], free)
    scores, bends = np.zeros((samples.count, NUMBERS)), np.zeros((samples.count, NUMBERS, NUMBERS))
    np.add.at(scores, samples.stretch, score)
    np.add.at(bends, samples.stretch, bend)
    outwards = np.maximum(bends[:, 2, 2], 1e-12)
    pulls = Pulls(
        scores=scores,
        bends=bends,
        precision=precision,
        loose=loose | (np.arange(NUMBERS) != MATTE),  # only how matte is exact at its bounds
        unexplained_px=_unexplained_px(samples, view, linear, free),
        step_px=samples.step_px,
    )
    return Limb(
        state=state,
        pulls=pulls,
        seen_px=1.0 / np.sqrt(outwards),
        offset_px=scores[:, 2] / outwards,
        edge=_edges(samples, view, linear, samples.count),
        moved_px=moved_px,
    )


def _unexplained_px(samples: Stretches, view: _View, linear: Linear, free: Floats) -> float:
    """The shift of the limb that would look as large as what the model leaves just inside it in most stretches, px.

    Beyond noise, the background's texture and chance: a shift that is common to all shows in no pull.
    """
    beside = samples.there & (np.abs(view.depth - BESIDE / 2) < BESIDE / 2)
    noise = samples.gain * np.maximum(linear.predicted, 0.0) + samples.read**2
    left2, outside = (samples.value - linear.predicted) ** 2, linear.design[..., 0]
    variance = noise + texture(left2 - noise, samples.there, outside)
    sums = np.zeros((3, samples.count))
    for row, of_sample in zip(sums, (left2 / variance - 1.0, beside, free[..., 2] ** 2 / variance), strict=True):
        np.add.at(row, samples.stretch, np.sum(of_sample, axis=1, where=beside))
    beyond, many, seen = sums[:, sums[1] > 0]
    if not len(many):
        return 0.0
    chance = CHANCE * np.sqrt(np.pi / (len(many) * np.median(many)))  # a median's sd is sqrt(pi/2) of a mean's
    common = max(float(np.median(beyond / many) - chance), 0.0)
    return float(np.sqrt(common * many.sum() / max(seen.sum(), 1e-12)))


def _edges(samples: Stretches, view: _View, linear: Linear, count: int) -> NDArray[np.bool_]:
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
