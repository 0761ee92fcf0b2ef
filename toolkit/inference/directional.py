"""Lobes fitted to values at given directions: measured materials, where there is no image.

As in a photograph everything but the shape is linear: for one shape the colours follow by non-negative least squares,
per channel, and only the shape is searched. Two measures of misfit, after Ngan, Durand & Matusik 2005: of the BRDF
times the cosine, which the highlight's peak rules, and of its cube root, which is nearer to what the eye sees.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats, readonly
from toolkit.reflectance import Cosines, Lobe
from toolkit.reflectance.fresnel import schlick_pair

Metric = Literal["linear", "cube-root"]

FLOOR = 1e-4  # sr^-1; below it the cube root's slope is taken as that of this value
RELINEARISATIONS = 12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DirectionalFit:
    """`shape` of the specular, then of the diffuse lobe; `colours` (columns, channels); `error` rms in the metric."""

    specular: str
    diffuse: str
    metric: Metric
    shape: tuple[float, ...]
    colours: Floats
    error: float

    def __post_init__(self) -> None:
        readonly(self)


def fit_directions(
    specular: Lobe,
    diffuse: Lobe,
    cosines: Cosines,
    values: Floats,
    *,
    metric: Metric = "linear",
    variant: Mapping[str, str] | None = None,
) -> DirectionalFit:
    """The best fit to `values` (N, channels), BRDF times n.l in sr^-1, from every combination of starts."""
    from scipy.optimize import minimize

    search = _Search(
        specular=specular, diffuse=diffuse, cosines=cosines, values=values, metric=metric, variant=variant or {}
    )
    parameters = specular.parameters + diffuse.parameters
    if not parameters:
        return search.at(())
    bounds = [(float(np.log(p.low)), float(np.log(p.high))) if p.log else (p.low, p.high) for p in parameters]
    found = []

    def misfit(u: NDArray[np.float64]) -> float:
        return search.at(search.natural(u)).error

    for start in product(*(p.starts for p in parameters)):
        first = np.array([np.log(s) if p.log else s for s, p in zip(start, parameters, strict=True)])
        descent = minimize(
            misfit,
            first.astype(np.float64),
            method="Nelder-Mead",
            bounds=bounds,
            options={"xatol": 1e-4, "fatol": 1e-9, "maxfev": 200 * len(parameters)},
        )
        found.append(search.at(search.natural(descent.x)))
    return min(found, key=lambda fit: fit.error)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    specular: Lobe
    diffuse: Lobe
    cosines: Cosines
    values: Floats
    metric: Metric
    variant: Mapping[str, str]

    def natural(self, u: Floats) -> tuple[float, ...]:
        parameters = self.specular.parameters + self.diffuse.parameters
        return tuple(float(np.exp(v)) if p.log else float(v) for p, v in zip(parameters, u, strict=True))

    def at(self, shape: tuple[float, ...]) -> DirectionalFit:
        """The colours and the error at one shape."""
        columns = self._columns(shape)
        colours = np.stack([_colours(columns, channel, self.metric) for channel in self.values.T], axis=1)
        misfit = _seen(columns @ colours, self.metric) - _seen(self.values, self.metric)
        return DirectionalFit(
            specular=self.specular.name,
            diffuse=self.diffuse.name,
            metric=self.metric,
            shape=shape,
            colours=colours,
            error=float(np.sqrt(np.mean(np.square(misfit)))),
        )

    def _columns(self, shape: tuple[float, ...]) -> Floats:
        """Body, and the specular lobe, by Schlick's pair where it wants Fresnel's factor: (N, 2 or 3)."""
        cut = len(self.specular.parameters)
        body = self.diffuse.value(self.cosines, shape[cut:])
        lobe = self.specular.value(self.cosines, shape[:cut], self.variant)
        parts = [f * lobe for f in schlick_pair(self.cosines.l_dot_h)] if self.specular.fresnel else [lobe]
        return np.stack([body, *parts], axis=1)


def _seen(values: Floats, metric: Metric) -> Floats:
    return np.cbrt(values) if metric == "cube-root" else values


def _colours(columns: Floats, channel: Floats, metric: Metric) -> Floats:
    """Non-negative least squares; for the cube root linearised about its own prediction again and again."""
    if metric == "linear":
        return _nonnegative(columns, channel)
    slope = 1.0 / (3.0 * np.maximum(channel, FLOOR) ** (2 / 3))
    colours = _nonnegative(columns * slope[:, None], channel * slope)
    error = _cube_root_error(columns, channel, colours)
    for _ in range(RELINEARISATIONS):
        model = np.maximum(columns @ colours, FLOOR)
        slope = 1.0 / (3.0 * model ** (2 / 3))
        target = np.cbrt(channel) - np.cbrt(model) + slope * model
        step = _nonnegative(columns * slope[:, None], target) - colours
        trial, share = error, 1.0
        while share > 1e-2:
            trial = _cube_root_error(columns, channel, colours + share * step)
            if trial < error:
                break
            share *= 0.5
        if trial >= error * (1.0 - 1e-9):
            break
        colours, error = colours + share * step, trial
    return colours


def _cube_root_error(columns: Floats, channel: Floats, colours: Floats) -> float:
    return float(np.sum(np.square(np.cbrt(columns @ colours) - np.cbrt(channel))))


def _nonnegative(columns: Floats, target: Floats) -> Floats:
    """Least squares with coefficients of at least 0, columns scaled to unit length first."""
    from scipy.optimize import nnls

    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    triangle, rotated = np.linalg.qr(columns / size, mode="reduced")[::-1]
    return np.asarray(nnls(triangle, rotated.T @ target)[0] / size)
