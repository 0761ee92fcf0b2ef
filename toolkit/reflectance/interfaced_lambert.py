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

from collections.abc import Callable, Sequence
from functools import lru_cache

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
_SMOOTH = 1e-4  # rad; smoother facets mask nothing but at grazing within as much
_SQRT2 = float(np.sqrt(2.0))


def evaluate(cosines: Cosines, diffuse_index: Number, diffuse_roughness_rad: Number) -> Floats:
    """The integral over the facets, in sr^-1."""
    return np.asarray(_each(_value, cosines, diffuse_index, diffuse_roughness_rad)[0])


def gradient(cosines: Cosines, diffuse_index: Number, diffuse_roughness_rad: Number) -> tuple[Floats, ...]:
    """The value, and its derivatives by diffuse_index and diffuse_roughness_rad."""
    return tuple(_each(_slopes, cosines, diffuse_index, diffuse_roughness_rad))


def _each(of: Callable[[Flat, float, float], Floats], cosines: Cosines, *shape: Number) -> Floats:
    return per_shape(of, (cosines.n_dot_l, cosines.n_dot_v, cosines.l_dot_v), shape)


def _value(flat: Flat, index: float, sigma: float) -> Floats:
    seen = _sight(flat[0], sigma)[0] * _sight(flat[1], sigma)[0]
    (facets,) = _facets_at([_table(index, sigma)], flat)
    return np.asarray(np.maximum(_over_view(flat, seen) * facets, 0.0)[None])


def _slopes(flat: Flat, index: float, sigma: float) -> Floats:
    plain, by_index, by_sigma = _facets_at([_table(index, sigma), *_derivative_tables(index, sigma)], flat)
    (g_light, d_light), (g_view, d_view) = _sight(flat[0], sigma), _sight(flat[1], sigma)
    seen, d_seen = g_light * g_view, d_light * g_view + g_light * d_view
    total = by_sigma * seen + plain * d_seen
    lit = _over_view(flat, np.asarray(plain > 0.0, float))
    return np.stack([lit * part for part in (seen * plain, seen * by_index, total)])


def _facets_at(tables: Sequence[Floats], flat: Flat) -> list[Floats]:
    """The facets' sums at N directions, bilinear between the nodes of tables (rows, rows, orders)."""
    (row, down), (column, along) = _place(flat[0]), _place(flat[1])
    waves, at = _azimuths(flat), row * _ROWS + column
    corners = (0, (1.0 - down) * (1.0 - along)), (1, (1.0 - down) * along), (_ROWS, down * (1.0 - along))
    return [
        sum(
            share * np.einsum("nk,nk->n", table.reshape(-1, _ORDERS).take(at + step, axis=0), waves)
            for step, share in (*corners, (_ROWS + 1, down * along))
        )
        for table in tables
    ]


def _place(cosine: Floats) -> tuple[NDArray[np.intp], Floats]:
    """The row at or below each cosine, and how far on to the next, (N,)."""
    inside = np.clip(cosine, 0.0, 1.0)
    row = np.minimum((np.sqrt(inside) * (_ROWS - 1)).astype(np.intp), _ROWS - 2)
    return row, (inside * (_ROWS - 1) ** 2 - np.square(row)) / (2 * row + 1)


def _sight(cosine: Floats, sigma: float) -> tuple[Floats, Floats]:
    """Smith's one-sided masking of facets with Gaussian slopes, and its derivative in sigma."""
    if sigma < _SMOOTH:
        return np.ones_like(cosine), np.zeros_like(cosine)
    alpha = _SQRT2 * sigma
    seen, by_alpha = g.BECKMANN.gradient(cosine, alpha)
    return seen, by_alpha * _SQRT2


def _over_view(flat: Flat, value: Floats) -> Floats:
    return np.asarray(value * (flat[0] > 0.0) / (np.pi * np.where(flat[1] > 0.0, flat[1], np.inf)))


def _azimuths(flat: Flat) -> Floats:
    """(N, orders) of cos(k dphi), twice that beyond k = 0, by Chebyshev's recursion."""
    light, view, l_dot_v = flat
    sines = np.sqrt(np.maximum(1.0 - np.square(light), 0.0) * np.maximum(1.0 - np.square(view), 0.0))
    cosine = np.clip((l_dot_v - light * view) / np.maximum(sines, 1e-30), -1.0, 1.0)
    terms = np.empty((_ORDERS, len(cosine)))
    terms[0], terms[1] = 1.0, cosine
    for order in range(2, _ORDERS):
        terms[order] = 2.0 * cosine * terms[order - 1] - terms[order - 2]
    terms[1:] *= 2.0
    return np.ascontiguousarray(terms.T)


Facets = tuple[Floats, Floats, Floats, Floats]  # cosines to them, their weights, d cosine / d sigma, d log weight


@lru_cache(maxsize=1)
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


def _products(one: Floats, other: Floats, *, both_ways: bool = False) -> Floats:
    """Sums over the slopes for every pairing of rows, and again with the rows exchanged: (rows, rows, orders)."""
    sums = one @ other.swapaxes(1, 2)
    if both_ways:
        sums = sums + sums.swapaxes(1, 2)
    return np.ascontiguousarray(np.moveaxis(sums, 0, -1))


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
    by_index, by_sigma = _expand(-scale * facing * d_index), _expand(scale * slope + share * stretch)
    return _products(by_index, orders, both_ways=True), _products(by_sigma, orders, both_ways=True)


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
