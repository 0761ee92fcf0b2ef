"""Smith's one-sided masking of any D, by its definition: G1 = cos / int D(m) max(v.m, 0) dm, tabulated in the cosine.

Over the azimuth the integral is closed; over the facets' angle it is summed. It conserves energy with any D, which
the G1 of another D does not: GGX's on a longer tail lets albedo reach 9 at grazing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from toolkit.records import Floats

from .cosines import Cosines, Number
from .masking import OneSided
from .per_shape import Flat, per_shape

Density = Callable[..., tuple[Floats, ...]]  # (cosines, *shape) -> D and its derivatives in the shape

_ROWS = 2048
_COSINES = np.square(np.linspace(0.0, 1.0, _ROWS))  # of the table: G1 within 2e-5
_NODES = 4  # in each interval of the facets' angle


def exact(density: Density) -> OneSided:
    """Smith's G1 of a density, and its derivatives in each of the density's shape numbers."""

    @lru_cache(maxsize=16)
    def table(*shape: float) -> Floats:
        return _table(density, shape)

    def rows(flat: Flat, *shape: float) -> Floats:
        return _at(table(*shape), flat[0])

    def first(flat: Flat, *shape: float) -> Floats:
        return _at(table(*shape)[:1], flat[0])

    def value(cosine: Floats, *shape: Number) -> Floats:
        return np.asarray(per_shape(first, [cosine], shape)[0])

    def gradient(cosine: Floats, *shape: Number) -> tuple[Floats, ...]:
        return tuple(per_shape(rows, [cosine], shape))

    return OneSided(value=value, gradient=gradient)


def _at(table: Floats, cosine: Floats) -> Floats:
    """Rows of a table (k, rows) at N cosines, linear between them: (k, N)."""
    inside = np.clip(cosine, 0.0, 1.0)
    row = np.minimum((np.sqrt(inside) * (_ROWS - 1)).astype(np.intp), _ROWS - 2)
    share = (inside * (_ROWS - 1) ** 2 - np.square(row)) / (2 * row + 1)
    return np.stack([values[row] + share * np.diff(values)[row] for values in table])


def _table(density: Density, shape: tuple[float, ...]) -> Floats:
    """G1 at the table's cosines, and under it its derivatives: (1 + shape numbers, rows)."""
    theta, weight = _facet_angles()
    values = np.stack(density(_facets(theta), *shape)) * weight  # (1 + k, facets)
    areas = values @ _facing().T
    g1 = _COSINES / areas[0]
    return np.concatenate([g1[None], -g1 * areas[1:] / areas[0]])


def _facet_angles() -> tuple[Floats, Floats]:
    """Angles of the facets from the normal, and the solid angle over 2 pi of each; finer towards the normal."""
    edges = np.concatenate([[0.0], np.geomspace(1e-4, 0.2, 28), np.linspace(0.2, np.pi / 2, 40)[1:]])
    node, share = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * np.diff(edges)[:, None]
    theta = (edges[:-1, None] + half * (1.0 + node)).ravel()
    return theta, (half * share).ravel() * np.sin(theta)


def _facets(theta: Floats) -> Cosines:
    """Cosines in which only what a density looks at, the facets' angle, has a meaning."""
    cosine, none = np.cos(theta), np.zeros_like(theta)
    return Cosines(
        n_dot_l=none,
        n_dot_v=none,
        l_dot_v=none,
        n_dot_h=cosine,
        l_dot_h=none,
        sin2_h=np.square(np.sin(theta)),
        r_dot_v=none,
    )


@lru_cache(maxsize=1)
def _facing() -> Floats:
    """The integral of max(v.m, 0) over a turn of the facets, for the table's cosines: (rows, facets)."""
    theta, _ = _facet_angles()
    across = np.sqrt(1.0 - np.square(_COSINES))[:, None] * np.sin(theta)
    along = _COSINES[:, None] * np.cos(theta)
    part = np.clip(-along / np.maximum(across, 1e-300), -1.0, 1.0)
    return np.asarray(2.0 * (along * np.arccos(part) + across * np.sqrt(1.0 - np.square(part))))
