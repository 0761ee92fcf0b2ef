"""The same material several times: each of its parameters pooled over its photographs, and who lies far out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .outliers import far_out, far_threshold
from .pool import Pooled, pooled
from .rows import CHANNELS, Lobes, Row

FEWEST = 2
HELD = 1e-7  # an sd below this share of the value is no error: a bound holds the value
FROM_PRIOR = 0.9  # a posterior no narrower than this share of its prior is the prior's, not the photograph's


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One photograph's number, in sds how far it lies from the others (None where they are too few), and whether
    that is farther than chance allows.
    """

    row: int
    value: float
    sd: float
    away: float | None
    outlier: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter of one channel; `pooled` is None where fewer than two photographs determine it."""

    name: str
    channel: str
    unit: str
    pooled: Pooled | None
    members: tuple[Member, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """One material. `lobes` are what all its photographs were fitted with, of the largest summed elpd; None: none."""

    name: str
    rows: tuple[int, ...]
    photographs: int
    lobes: Lobes | None
    parameters: tuple[Parameter, ...]
    relative: bool

    @property
    def outliers(self) -> frozenset[int]:
        """Rows that lie far out in any parameter."""
        return frozenset(member.row for one in self.parameters for member in one.members if member.outlier)


def materials(rows: Sequence[Row]) -> list[Material]:
    """Every named material, in the order of its first photograph."""
    named: dict[str, list[int]] = {}
    for index, row in enumerate(rows):
        if row.cells["material"]:
            named.setdefault(str(row.cells["material"]), []).append(index)
    return [_material(name, indices, rows) for name, indices in named.items()]


def _material(name: str, indices: Sequence[int], rows: Sequence[Row]) -> Material:
    usable = tuple(index for index in indices if rows[index].fits)
    lobes = common_lobes([rows[index].fits for index in usable])
    return Material(
        name=name,
        rows=usable,
        photographs=len(indices),
        lobes=lobes,
        parameters=() if lobes is None else tuple(_parameters(lobes, usable, rows)),
        relative=any(rows[index].cells.get("scale") != "absolute" for index in usable),
    )


def common_lobes(fits: Sequence[Mapping[Lobes, object]]) -> Lobes | None:
    """Of the lobes fitted to every photograph those that predict all of them best."""
    if not fits:
        return None
    shared = [lobes for lobes in fits[0] if all(lobes in one for one in fits)]
    return max(shared, key=lambda lobes: sum(getattr(one[lobes], "elpd", 0.0) for one in fits), default=None)


def _parameters(lobes: Lobes, usable: Sequence[int], rows: Sequence[Row]) -> list[Parameter]:
    first = rows[usable[0]].fits[lobes].parameters
    return [
        _parameter(name, channel, unit, lobes, usable, rows)
        for name, (estimates, _, _, unit) in first.items()
        for channel in range(len(estimates))
    ]


def _parameter(
    name: str, channel: int, unit: str, lobes: Lobes, usable: Sequence[int], rows: Sequence[Row]
) -> Parameter:
    told = [(index, *_number(rows[index].fits[lobes].parameters.get(name), channel)) for index in usable]
    known = [(index, value, sd) for index, value, sd in told if value is not None and sd is not None]
    values, sds = np.array([value for _, value, _ in known]), np.array([sd for _, _, sd in known])
    away = far_out(values, sds)
    threshold = far_threshold(len(known)) if len(known) >= FEWEST else math.inf
    return Parameter(
        name=name,
        channel=CHANNELS[channel] if len(rows[usable[0]].fits[lobes].parameters[name][0]) > 1 else "",
        unit="" if unit == "1" else unit,
        pooled=pooled(values, sds) if len(known) >= FEWEST else None,
        members=tuple(
            Member(
                row=index,
                value=value,
                sd=sd,
                away=float(z) if math.isfinite(z) else None,
                outlier=bool(abs(z) > threshold),
            )
            for (index, value, sd), z in zip(known, away, strict=True)
        ),
    )


def _number(
    told: tuple[tuple[float | None, ...], tuple[float | None, ...], tuple[float | None, ...], str] | None, channel: int
) -> tuple[float | None, float | None]:
    """Estimate and sd, where the photograph determines them."""
    if told is None:
        return None, None
    estimates, sds, ratios, _ = told
    value, sd, ratio = (part[min(channel, len(part) - 1)] for part in (estimates, sds, ratios))
    if value is None or sd is None or (ratio is not None and ratio > FROM_PRIOR) or sd <= HELD * abs(value):
        return None, None
    return value, sd
