r"""Interfaced Lambertian facets: a matte body under a clear coat whose surface is itself rough.

For paint, plastic and lacquer that are not quite smooth: each facet is a small Lambertian body under a smooth
dielectric interface, and the facets' slopes are Gaussian (Simonot 2009; with Smith's masking as in Meneveaux et al.
2018). At roughness 0 it is `wolff`. The limb is brighter than Wolff's, because tilted facets meet grazing light less
flatly. On a real glossy ball it leaves about 1.6 % off the highlight where Wolff leaves 2.1 and Lambert 3.7.
`diffuse_albedo` has Wolff's meaning.

The integral over the facets is done once per pair of shape numbers, on a grid of the two cosines, expanded in the
azimuth between light and view.

    >>> from toolkit.reflectance import LOBES, Cosines
    >>> import numpy as np
    >>> facing = Cosines.of(*(np.array([[0.0, 0.0, 1.0]]) for _ in range(3)))
    >>> LOBES["interfaced-lambert"].value(facing, (1.5, 0.1)).round(2)
    array([0.29])
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from toolkit.records import Floats

from . import masking as g
from .cosines import Cosines, Number
from .fresnel import dielectric, dielectric_derivative, dielectric_slope
from .lobe import Claim, Lobe, Parameter, register
from .per_shape import Flat, per_shape

_SLOPES = 16  # Gauss-Legendre nodes in the slope, out to _STEEPEST
_STEEPEST = 3.3  # in units of sqrt(2) sigma; 2e-5 of the facets are steeper
_AZIMUTHS = 24  # of the facets, over half a turn
_ORDERS = 8  # of the expansion in the azimuth between light and view
_ROWS = 192  # of the tables along each cosine, spaced evenly in its square root
_BLOCK = 8192  # directions at a time, so that their rows stay in the processor's cache
_SMOOTH = 1e-4  # rad; smoother facets mask nothing but at grazing within as much
_SQRT2 = float(np.sqrt(2.0))


def evaluate(cosines: Cosines, diffuse_index: Number, diffuse_roughness_rad: Number) -> Floats:
    """The integral over the facets, in sr^-1."""
    return np.asarray(_each(_value, cosines, diffuse_index, diffuse_roughness_rad)[0])


def gradient(cosines: Cosines, diffuse_index: Number, diffuse_roughness_rad: Number) -> tuple[Floats, ...]:
    """By diffuse_index and diffuse_roughness_rad."""
    by = _each(_slopes, cosines, diffuse_index, diffuse_roughness_rad)
    return by[0], by[1]


def _each(of: Callable[[Flat, float, float], Floats], cosines: Cosines, *shape: Number) -> Floats:
    return per_shape(partial(_blocks, of), (cosines.n_dot_l, cosines.n_dot_v, cosines.l_dot_v), shape)


def _blocks(of: Callable[[Flat, float, float], Floats], flat: Flat, index: float, sigma: float) -> Floats:
    starts = range(0, max(flat[0].size, 1), _BLOCK)
    parts = [of(tuple(part[i : i + _BLOCK] for part in flat), index, sigma) for i in starts]
    return np.concatenate(parts, axis=-1)


def _value(flat: Flat, index: float, sigma: float) -> Floats:
    seen = _sight(flat[0], sigma)[0] * _sight(flat[1], sigma)[0]
    return np.asarray(np.maximum(_over_view(flat, seen) * _facets_at(_table(index, sigma), flat), 0.0)[None])


def _slopes(flat: Flat, index: float, sigma: float) -> Floats:
    plain = _facets_at(_table(index, sigma), flat)
    by_index, by_sigma = (_facets_at(table, flat) * (plain > 0.0) for table in _derivative_tables(index, sigma))
    (g_light, d_light), (g_view, d_view) = _sight(flat[0], sigma), _sight(flat[1], sigma)
    seen, d_seen = g_light * g_view, d_light * g_view + g_light * d_view
    total = by_sigma * seen + np.maximum(plain, 0.0) * d_seen
    return np.stack([_over_view(flat, seen * by_index), _over_view(flat, total)])


def _facets_at(table: Floats, flat: Flat) -> Floats:
    """The facets' sum at N directions, bilinear between the nodes of a table (rows, rows, orders)."""
    (row, down), (column, along) = _place(flat[0]), _place(flat[1])
    upper = table[row, column] * (1.0 - along) + table[row, column + 1] * along
    lower = table[row + 1, column] * (1.0 - along) + table[row + 1, column + 1] * along
    return np.asarray(np.einsum("nk,nk->n", upper * (1.0 - down) + lower * down, _azimuths(flat)))


def _place(cosine: Floats) -> tuple[NDArray[np.intp], Floats]:
    """The row at or below each cosine, and how far on to the next, (N, 1)."""
    inside = np.clip(cosine, 0.0, 1.0)
    row = np.minimum((np.sqrt(inside) * (_ROWS - 1)).astype(np.intp), _ROWS - 2)
    return row, ((inside * (_ROWS - 1) ** 2 - np.square(row)) / (2 * row + 1))[:, None]


def _sight(cosine: Floats, sigma: float) -> tuple[Floats, Floats]:
    """Smith's one-sided masking of facets with Gaussian slopes, and its derivative in sigma."""
    if sigma < _SMOOTH:
        return np.ones_like(cosine), np.zeros_like(cosine)
    alpha = _SQRT2 * sigma
    return g.BECKMANN.value(cosine, alpha), g.BECKMANN.derivatives(cosine, alpha)[0] * _SQRT2


def _over_view(flat: Flat, value: Floats) -> Floats:
    return np.asarray(value * (flat[0] > 0.0) / (np.pi * np.where(flat[1] > 0.0, flat[1], np.inf)))


def _azimuths(flat: Flat) -> Floats:
    """(N, orders) of cos(k dphi), twice that beyond k = 0, by Chebyshev's recursion."""
    light, view, l_dot_v = flat
    sines = np.sqrt(np.maximum(1.0 - np.square(light), 0.0) * np.maximum(1.0 - np.square(view), 0.0))
    cosine = np.clip((l_dot_v - light * view) / np.maximum(sines, 1e-30), -1.0, 1.0)
    terms = [np.ones_like(cosine), cosine]
    for _ in range(2, _ORDERS):
        terms.append(2.0 * cosine * terms[-1] - terms[-2])
    return np.stack([terms[0], *(2.0 * term for term in terms[1:])], axis=1)


Facets = tuple[Floats, Floats, Floats, Floats]  # cosines to them, their weights, d cosine / d sigma, d log weight


def _facets(sigma: float) -> Facets:
    """How the facets face a direction at each of the tables' cosines: (rows, slopes, azimuths), and their weights."""
    cosine = np.square(np.linspace(0.0, 1.0, _ROWS))[:, None, None]
    squared, weight = _slope_nodes()
    towards = np.sqrt((1.0 - np.square(cosine)) * 2.0 * squared) * np.cos(_facet_azimuths())
    length = np.sqrt(1.0 + 2.0 * sigma * sigma * squared)  # 1 / cos(theta_m)
    facing = (sigma * towards + cosine) / length
    turn = np.where(facing > 0.0, (towards - 2.0 * sigma * squared * facing / length) / length, 0.0)
    return np.maximum(facing, 0.0), np.sqrt(weight * length), turn, sigma * squared / np.square(length)


@lru_cache(maxsize=1)
def _slope_nodes() -> tuple[Floats, Floats]:
    """Squared slopes in units of 2 sigma^2, and the share of facets that each stands for, (slopes, 1)."""
    node, weight = np.polynomial.legendre.leggauss(_SLOPES)
    slope = 0.5 * _STEEPEST * (1.0 + node[:, None])
    share = weight[:, None] * slope * np.exp(-np.square(slope))
    return np.square(slope), share / share.sum()


def _facet_azimuths() -> Floats:
    return np.asarray((np.arange(_AZIMUTHS) + 0.5) * np.pi / _AZIMUTHS)


def _expand(values: Floats) -> Floats:
    """For each order of the azimuth's expansion: (orders, rows, slopes)."""
    waves = np.cos(np.arange(_ORDERS) * _facet_azimuths()[:, None]) / _AZIMUTHS
    return np.ascontiguousarray(np.moveaxis(values @ waves, -1, 0))


def _products(one: Floats, other: Floats) -> Floats:
    """Sums over the slopes for every pairing of rows: (rows, rows, orders)."""
    return np.ascontiguousarray(np.moveaxis(one @ other.swapaxes(1, 2), 0, -1))


@lru_cache(maxsize=8)
def _table(index: float, sigma: float) -> Floats:
    """What facets send from one cosine to another, by order of the azimuth's expansion: (rows, rows, orders)."""
    facing, scale, _, _ = _facets(sigma)
    orders = _expand(scale * facing * (1.0 - dielectric(facing, index)))
    return _products(orders, orders)


@lru_cache(maxsize=4)
def _derivative_tables(index: float, sigma: float) -> tuple[Floats, Floats]:
    """The table's derivatives in index and in sigma."""
    facing, scale, turn, stretch = _facets(sigma)
    reflected, d_index = dielectric_derivative(facing, index)
    share = scale * facing * (1.0 - reflected)
    slope = (1.0 - reflected - facing * dielectric_slope(facing, index)) * turn
    orders = _expand(share)
    by_index = _products(_expand(-scale * facing * d_index), orders)
    by_sigma = _products(_expand(scale * slope + share * stretch), orders)
    return by_index + by_index.swapaxes(0, 1), by_sigma + by_sigma.swapaxes(0, 1)


register(
    Lobe(
        name="interfaced-lambert",
        title="Interfaced Lambertian facets (rough dielectric)",
        kind="diffuse",
        colour="diffuse_albedo",
        parameters=(
            Parameter(
                name="diffuse_index",
                unit="1",
                low=1.3,
                high=1.8,
                log=False,
                starts=(1.4, 1.6),
                typical="1.5 plastic and paint",
                meaning="refractive index of the clear coat over the body",
            ),
            Parameter(
                name="diffuse_roughness_rad",
                unit="rad",
                low=0.0,
                high=0.4,
                log=False,
                starts=(0.05, 0.2),
                typical="0.1 a slightly textured coat, 0.3 satin",
                meaning="standard deviation of the coated facets' slopes along one axis",
            ),
        ),
        evaluate=evaluate,
        gradient=gradient,
        formula=r"\frac{1}{\pi\, n \cdot v} \int D(m)\, G\, (l \cdot m)(v \cdot m) "
        r"\bigl(1 - F(l \cdot m)\bigr) \bigl(1 - F(v \cdot m)\bigr)\, \mathrm{d}m",
        source="simonot2009",
        claims=frozenset({Claim.RECIPROCAL, Claim.CONSERVES_ENERGY, Claim.BOUNDED_AT_GRAZING_VIEW}),
    )
)
