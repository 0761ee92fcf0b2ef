"""What a fit solves: one model on the cells of photographs, linear in all but the shape; and where it comes to rest."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from toolkit.records import Floats, Noise, Scene, scale_of

from .cells import Cells, ChannelCells
from .columns import Columns, columns
from .model import Fresnel, Model, fresnel_of, names_of
from .normal import Layout, Normal, Prior, Sums, Weighing, combine, lay_out, sums_of, weigh
from .priors import prior_of
from .views import View
from .weights import Weights, weights_of

Evaluated = tuple[Columns, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One model on the cells of one photograph, or of several of one material; three channels of each, in order."""

    model: Model
    views: tuple[View, ...]
    fresnel: Fresnel
    layout: Layout
    prior: Prior
    extras: tuple[Floats, ...]  # per channel (n, q): its photograph's further columns, such as calibration shifts
    tempering: float = 1.0  # how many times less than by their noise the data weigh

    @property
    def channels(self) -> tuple[ChannelCells, ...]:
        """The channels of all photographs."""
        return tuple(data for view in self.views for data in view.cells.channels)

    @property
    def samples(self) -> float:
        """How many samples the cells' means hold."""
        return sum(float(data.count[: data.cells].sum()) for data in self.channels)

    @property
    def scale(self) -> Literal["absolute", "relative"]:
        """Absolute where one photograph's irradiance is known."""
        return scale_of([view.scene for view in self.views])

    def with_extras(self, extras: tuple[Floats, ...], precision: Floats, centre: Floats) -> Problem:
        """With further columns (n, q) per channel, its photograph's own, and the Gaussian prior of all of them."""
        return replace(
            self,
            extras=extras,
            layout=self.layout.with_extras([one.shape[1] for one in extras[::3]]),
            prior=self.prior.joined(precision, centre),
        )

    def seen_in(self, views: Iterable[View]) -> Problem:
        """Of other samples or other photographs of the same material, as many as before, without further columns."""
        views = tuple(views)
        return replace(
            self,
            views=views,
            layout=self.layout.with_extras([0] * len(views)),
            prior=self.prior.first(len(self.layout.names)),
            extras=_no_extras(views),
        )

    def columns(self, u: Floats, *, derivatives: bool = False) -> Evaluated:
        """The model's columns at one shape."""
        found = [
            columns(self.model, self.fresnel, view.lights, view.cells, u, derivatives=derivatives)
            for view in self.views
        ]
        return tuple(one for three in found for one in three)

    def assemble(self, cols: tuple[Columns, ...], weights: Weighing, at: Floats | None = None) -> Normal:
        """The normal equations for columns already evaluated; the shape's range counts as its prior's width."""
        return self.combine(cols, sums_of(cols, self.channels, weights), weights, at)

    def combine(self, cols: Evaluated, sums: tuple[Sums, ...], weights: Weighing, at: Floats | None = None) -> Normal:
        """The normal equations from sums over the cells already taken."""
        normal = combine(cols, sums, weights, self.layout, self.prior, at)
        if at is not None:
            shapes = np.arange(self.layout.size, len(normal.rhs))
            normal.matrix[shapes, shapes] += self.shape_precision
        return normal

    @property
    def shape_precision(self) -> Floats:
        """What the shape numbers' ranges count as (D,)."""
        low, high = self.model.bounds()
        return np.asarray(12.0 / (high - low) ** 2)

    @property
    def known_precision(self) -> Floats:
        """What is known of linear unknowns and shape without the data (P + D, P + D)."""
        return block_diag(self.prior.precision, np.diag(self.shape_precision))

    def predict(self, cols: Evaluated, x: Floats, step: Floats | None = None) -> tuple[Floats, ...]:
        """What is predicted of each channel's data, after a `step` (D,) of the shape to first order."""
        found, layout = [], self.layout
        for col, index, extra, own in zip(cols, layout.index, self.extras, layout.extras, strict=True):
            along = col.along(x[index])
            mix = along[0] if step is None else along[0] + step @ along[1:]
            found.append(mix @ col.rows + extra @ x[own] if extra.size else mix @ col.rows)
        return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Optimum:
    """Where a fit came to rest. `joint` is the normal matrix of linear unknowns, then shape; `u` the shape."""

    problem: Problem
    u: Floats
    x: Floats
    weights: Weighing
    joint: Floats
    chi2: float  # with the prior's part
    on_bound: NDArray[np.bool_]  # linear unknowns, then shape
    status: str
    at: Floats  # the shape, or one short step before, over which all is linear
    columns: Evaluated  # at that, with their derivatives
    predicted: tuple[Floats, ...]  # of each channel's data

    def own(self, photograph: int) -> NDArray[np.intp]:
        """Which unknowns (p,) a photograph depends on."""
        layout, first = self.problem.layout, 3 * photograph
        named = np.unique(np.concatenate(layout.index[first : first + 3]))
        return np.concatenate([named, self._extras_and_shape(first)])

    def slopes(self, channel: int) -> tuple[NDArray[np.intp], Floats]:
        """Which unknowns (p,) a channel depends on, and the derivatives (p, m) of its data's prediction in them."""
        layout, columns = self.problem.layout, self.columns[channel]
        own = layout.index[channel]
        slopes = columns.slopes(columns.along(self.x[own])) @ columns.rows
        index = np.concatenate([own, self._extras_and_shape(channel)])
        return index, np.concatenate([slopes[: len(own)], self.problem.extras[channel].T, slopes[len(own) :]])

    def _extras_and_shape(self, channel: int) -> NDArray[np.intp]:
        extra, size = self.problem.layout.extras[channel], self.problem.layout.size
        return np.concatenate([np.arange(extra.start, extra.stop), np.arange(size, len(self.joint))])


def pose(model: Model, scene: Scene, cells: Cells, noise: Noise) -> Problem:
    """Set up the fit of one photograph."""
    return pose_views(model, [View.of(scene, cells, noise)])


def pose_views(
    model: Model,
    views: Sequence[View],
    *,
    fresnel: Fresnel | None = None,
    tempering: float = 1.0,
) -> Problem:
    """Set up the fit of several photographs of one material.

    `fresnel` tells how F is known to enter; `tempering` how many times less than by their noise the data weigh.
    """
    views = [view.under_whole_lights() if model.specular.sees_source else view for view in views]
    fresnel = fresnel or fresnel_of(model, [view.scene for view in views])
    layout = lay_out(names_of(model, fresnel), neutral=model.neutral, photographs=len(views))
    return Problem(
        model=model,
        views=tuple(views),
        fresnel=fresnel,
        layout=layout,
        prior=prior_of(layout, views),
        extras=_no_extras(views),
        tempering=tempering,
    )


def _no_extras(views: Iterable[View]) -> tuple[Floats, ...]:
    return tuple(np.zeros((len(data.rows), 0)) for view in views for data in view.cells.channels)


def weights_at(problem: Problem, predicted: tuple[Floats, ...]) -> tuple[Weights, ...]:
    """The tempered weights of each channel's data, predicted as (m,); none where a clipped cell is reached."""
    channels = [(view.noise, c, data) for view in problem.views for c, data in enumerate(view.cells.channels)]
    return tuple(
        weights_of(data, noise, c, here).scaled(1.0 / problem.tempering)
        for (noise, c, data), here in zip(channels, predicted, strict=True)
    )


def weighing_at(problem: Problem, predicted: tuple[Floats, ...]) -> Weighing:
    """The same with all that follows from them and the extra columns."""
    return weigh(weights_at(problem, predicted), problem.extras)


def f0_of(problem: Problem, x: Floats) -> Floats:
    """F0 per channel (..., 3) of linear unknowns (..., P), where the fit has one."""
    if problem.fresnel.kind == "known":
        return problem.layout.of("specular_f0", x)
    scale = np.maximum(problem.layout.of("specular_scale", x), 1e-30)
    return np.asarray(problem.layout.of("specular_scale_f0", x) / scale)
