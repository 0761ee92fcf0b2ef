"""A model's columns on the cells: what a prediction is a sum of, with the colours for coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance.cosines import constant
from toolkit.reflectance.lobe import Lobe

from .cells import Cells, ChannelCells
from .lit import Lit
from .model import TYPICAL_F0, Fresnel, Model

_Shape = tuple[Floats | float, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """One channel's columns on its data: what a prediction is a sum of.

    Many of them are the same but for a number, as F times a lobe under a far light. So `rows` (..., r, n) holds what
    differs, and `mix` (1 + D, 1 + k, r) how the part with a known coefficient and the k columns are sums of it, at a
    shape and then their derivatives in each of the D shape numbers, in the searched coordinate. Leading axes of the
    rows where several shapes are evaluated at once.
    """

    rows: Floats
    mix: Floats

    @property
    def table(self) -> Floats:
        """All of them written out: (..., 1 + k, n) at the shape, without the derivatives."""
        return np.asarray(self.mix[0] @ self.rows)

    def along(self, x: Floats) -> Floats:
        """The prediction by coefficients (k,), then its derivatives in the shape, as sums of the rows (1 + D, r)."""
        return np.asarray(self.mix[:, 0] + x @ self.mix[:, 1:])

    def slopes(self, along: Floats) -> Floats:
        """Its derivatives in each coefficient, then in the shape, as sums of the rows (k + D, r); `along` as above."""
        return np.concatenate([self.mix[0, 1:], along[1:]])


def columns(
    model: Model,
    fresnel: Fresnel,
    lights: tuple[Lit, ...],
    cells: Cells,
    u: Floats,
    *,
    derivatives: bool = False,
) -> tuple[Columns, Columns, Columns]:
    """The columns of all three channels at one shape; `lights` are those of the cells' nodes (S, 4, N)."""
    shape = model.natural(u)
    sharp, soft = model.split(shape)
    if derivatives:
        scales = [1.0] + [number if p.log else 1.0 for number, p in zip(shape, model.parameters, strict=True)]
        parts = [zip(_with_gradients(lit, model, sharp, soft), scales, strict=True) for lit in lights]
    else:
        parts = [zip([_values(lit, model, sharp, soft)], [1.0], strict=True) for lit in lights]
    blocks = [
        [_terms(lit, fresnel, *lobes, scale) for lobes, scale in mine] for lit, mine in zip(lights, parts, strict=True)
    ]
    return _channels(blocks, [lit.colour for lit in lights], cells, ())


def columns_of_many(
    model: Model, fresnel: Fresnel, lights: tuple[Lit, ...], cells: Cells, u: Floats
) -> tuple[Columns, Columns, Columns]:
    """The columns of all three channels at several shapes (S, D) at once."""
    sharp, soft = np.split(u, [len(model.specular.parameters)], axis=1)
    numbers = _of_many(model.specular, sharp), _of_many(model.diffuse, soft)
    blocks = [[_terms(lit, fresnel, *_values(lit, model, *numbers))] for lit in lights]
    return _channels(blocks, [lit.colour for lit in lights], cells, (len(u),))


def highlights_of_many(
    model: Model, fresnel: Fresnel, lights: tuple[Lit, ...], cells: Cells, u: Floats
) -> tuple[Columns, Columns, Columns]:
    """What of them the specular lobe makes, at several of its shapes (S, D) at once."""
    shape = _of_many(model.specular, u)
    blocks = [[_terms(lit, fresnel, None, model.specular.value(lit.cosines, shape, model.variant))] for lit in lights]
    return _channels(blocks, [lit.colour for lit in lights], cells, (len(u),))


def bodies_of_many(
    model: Model, fresnel: Fresnel, lights: tuple[Lit, ...], cells: Cells, u: Floats
) -> tuple[Columns, Columns, Columns]:
    """What of them the diffuse lobe makes, at several of its shapes (S, D) at once."""
    shape = _of_many(model.diffuse, u)
    bodies = [_with_returned(model.diffuse.value(lit.cosines, shape), lit) for lit in lights]
    blocks = [[_terms(lit, fresnel, body, None)] for lit, body in zip(lights, bodies, strict=True)]
    return _channels(blocks, [lit.colour for lit in lights], cells, (len(u),))


def _of_many(lobe: Lobe, u: Floats) -> _Shape:
    """A lobe's shape numbers from several of their coordinates (S, D), to be broadcast over nodes."""
    numbers = (np.exp(v) if p.log else v for v, p in zip(u.T, lobe.parameters, strict=True))
    return tuple(v[:, None, None, None] for v in numbers)


def radiance(
    model: Model, fresnel: Fresnel, lit: Lit, u: Floats, coefficients: Sequence[Floats], cells: Cells
) -> tuple[Floats, Floats, Floats]:
    """What one light's part in each channel is at that channel's own nodes (4, N), the pedestal left out.

    `coefficients` hold a channel's linear ones, in the order of its columns.
    """
    terms = _terms(lit, fresnel, *_values(lit, model, *model.split(model.natural(u))))
    found = []
    for c, data in enumerate(cells.channels):
        total = np.zeros(())
        for (nodes, scale), number in zip(terms, (1.0, *coefficients[c]), strict=False):
            if nodes is not None:
                total = total + nodes[data.place] * (scale * number * lit.colour[c])
        found.append(total)
    return found[0], found[1], found[2]


_Term = tuple[Floats | None, float]  # a table over the nodes (..., S, 4, N), or None for zeros, and a factor


def _values(lit: Lit, model: Model, sharp: _Shape, soft: _Shape) -> tuple[Floats, Floats]:
    """The two lobes under one light: diffuse, with what comes back from around; specular."""
    matte = _with_returned(model.diffuse.value(lit.cosines, soft), lit)
    return matte, model.specular.value(lit.cosines, sharp, model.variant)


def _with_returned(matte: Floats, lit: Lit) -> Floats:
    """The diffuse lobe with what comes back from around."""
    return matte if lit.returned is None else matte + lit.returned


def _with_gradients(lit: Lit, model: Model, sharp: _Shape, soft: _Shape) -> list[tuple[Floats | None, Floats | None]]:
    """The two lobes, and their derivatives in each shape number; None where a lobe does not depend on it."""
    gloss, *by_sharp = model.specular.with_derivatives(lit.cosines, sharp, model.variant)
    body, *by_soft = model.diffuse.with_derivatives(lit.cosines, soft)
    body = _with_returned(body, lit)
    return [(body, gloss), *((None, slope) for slope in by_sharp), *((slope, None) for slope in by_soft)]


def _terms(
    lit: Lit, fresnel: Fresnel, diffuse: Floats | None, specular: Floats | None, scale: float = 1.0
) -> list[_Term]:
    """At the nodes: what has a known coefficient first, then one table for each coefficient."""
    far = constant(lit.falloff)
    if far is None:
        diffuse, specular = (None if part is None else part * lit.falloff for part in (diffuse, specular))
    else:
        scale *= far
    body, nothing = (diffuse, scale), (None, 0.0)
    if fresnel.kind == "none":
        return [nothing, body, (specular, scale)]
    b, a = fresnel.pair(lit)
    if fresnel.kind == "strength":
        ratio = (a + b * TYPICAL_F0) / float(fresnel.at_mirror(TYPICAL_F0))
        return [nothing, body, _times(specular, ratio, scale)]
    without, with_a = _times(specular, b, scale), _times(specular, a, scale)
    return [with_a, body, without] if fresnel.kind == "known" else [nothing, body, without, with_a]


def _times(table: Floats | None, factor: Floats | float, scale: float) -> _Term:
    if table is None or isinstance(factor, float):
        return table, scale * float(factor) if isinstance(factor, float) else 0.0
    return table * factor, scale


def _channels(
    blocks: list[list[list[_Term]]], colours: list[Floats], cells: Cells, batch: tuple[int, ...]
) -> tuple[Columns, Columns, Columns]:
    """Each term's part in the data, summed over the lights; channels that share their cells and nodes share it.

    `blocks` hold for each light, then for the shape and each of its numbers, the terms at the nodes.
    """
    shared: dict[tuple[int, int, bool], list[Columns]] = {}
    found: list[Columns] = []
    for c, data in enumerate(cells.channels):
        if data.sharing not in shared:
            shared[data.sharing] = [_told(terms, data, batch) for terms in blocks]
        alike = [b for b in range(c) if cells.channels[b].sharing == data.sharing and _same_light(colours, b, c)]
        mine = shared[data.sharing]
        found.append(found[alike[0]] if alike else _lit(mine, [float(colour[c]) for colour in colours]))
    return found[0], found[1], found[2]


def _same_light(colours: list[Floats], one: int, other: int) -> bool:
    return all(colour[one] == colour[other] for colour in colours)


def _told(blocks: list[list[_Term]], data: ChannelCells, batch: tuple[int, ...]) -> Columns:
    """One light's terms as the nodes give a channel's data; the mix has nothing yet of the last row, the pedestal."""
    tables = {id(nodes): nodes for terms in blocks for nodes, _ in terms if nodes is not None}
    rows, place = np.empty((*batch, len(tables) + 1, len(data.rows))), {key: i for i, key in enumerate(tables)}
    for i, table in enumerate(tables.values()):
        rows[..., i, :] = data.predicted(table)
    rows[..., -1, : data.cells], rows[..., -1, data.cells :] = 1.0, 0.0
    mix = np.zeros((len(blocks), len(blocks[0]) + 1, len(tables) + 1))
    for b, terms in enumerate(blocks):
        for i, (nodes, scale) in enumerate(terms):
            if nodes is not None:
                mix[b, i, place[id(nodes)]] = scale
    return Columns(rows=rows, mix=mix)


def _lit(lights: list[Columns], irradiances: list[float]) -> Columns:
    """The sum over a channel's lights, the pedestal once."""
    rows, mix = lights[0].rows, lights[0].mix * irradiances[0]
    if len(lights) > 1:
        some = np.nonzero(sum(np.abs(light.mix).sum(axis=-1) for light in lights))
        parts = [(e * light.mix[some]) @ light.rows for e, light in zip(irradiances, lights, strict=True)]
        rows = np.concatenate([sum(parts[1:], start=parts[0]), rows[..., -1:, :]], axis=-2)
        mix = np.zeros((*mix.shape[:2], rows.shape[-2]))
        mix[*some, np.arange(len(some[0]))] = 1.0
    mix[0, -1, -1] = 1.0
    return Columns(rows=rows, mix=mix)
