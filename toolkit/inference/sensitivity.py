"""How the predicted radiance changes with each shift of the calibration.

Every lobe is a function of three cosines, n.l, n.v and l.v. A shift touches nothing else but the light's irradiance,
how far a blur spreads the nodes and, for a lobe that holds it, the size of the light's disc. So the lobes are
differentiated by their cosines once for all shifts, and every shift tells how it moves these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Light, Scene
from toolkit.reflectance.cosines import Cosines, dots, once

from .cells import ChannelCells
from .descend import Projection
from .lit import Lit, colour_of, lights_of
from .model import radiance
from .nuisances import Shifts, shifted
from .problem import Optimum
from .views import View

RELATIVE_STEP = 1e-3  # of a shift's prior sd: far above rounding, far below curvature
COSINE_STEP = 1e-8  # far above rounding, far below the square of the sharpest lobe's width


def sensitivity(
    optimum: Optimum | Projection, told: Sequence[View], here: Sequence[View], shifts: Shifts, total: Floats
) -> tuple[Floats, ...]:
    """Per channel, the change of the predicted radiance with each shift (n, q), by differences.

    `told` are the photographs as told, `here` the same in scenes shifted by `total`, where the change is asked for.
    """
    found: list[Floats] = []
    steps = np.diag(RELATIVE_STEP * shifts.sd)
    for v, (first, view) in enumerate(zip(told, here, strict=True)):
        slopes = [np.zeros((len(steps), len(data.rows))) for data in view.cells.channels]
        lights = _slopes(optimum, view, v)
        for j in np.flatnonzero(shifts.photograph == v):
            scene = shifted(first.scene, shifts, total + steps[j], v)
            for slope, change in zip(slopes, _change(view, lights, scene), strict=True):
                slope[j] = change / steps[j, j]
        found += [slope.T for slope in slopes]
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Slopes:
    """One light's radiance in each channel, (4, N) at the channel's own nodes, and its slopes there."""

    lit: Lit
    cosines: tuple[Floats, Floats, Floats]
    value: tuple[Floats, ...]
    by_cosine: tuple[tuple[Floats, ...], ...]  # by n.l, n.v and l.v
    by_size: tuple[Floats, ...] | None  # by the angular radius of the light's disc, where the lobe holds it


def _slopes(optimum: Optimum | Projection, view: View, photograph: int) -> list[_Slopes]:
    return [
        _slopes_under(optimum, view, light, lit, photograph)
        for light, lit in zip(lights_of(view.scene, whole=view.whole), view.lights, strict=True)
    ]


def _slopes_under(optimum: Optimum | Projection, view: View, light: Light, lit: Lit, photograph: int) -> _Slopes:
    problem, radius = optimum.problem, lit.cosines.source_radius_rad
    linear = [optimum.x[i] for i in problem.layout.index[3 * photograph : 3 * photograph + 3]]

    def value(cosines: Cosines) -> tuple[Floats, ...]:
        return radiance(problem.model, problem.fresnel, lit.at(cosines), optimum.u, linear, view.cells)

    def slope(cosines: Cosines, step: float) -> tuple[Floats, ...]:
        return tuple((there - before) / step for there, before in zip(value(cosines), here, strict=True))

    here, seen = value(lit.cosines), view.seen
    less_lit, less_seen, nearer = lit.cosines.stepped(COSINE_STEP)
    by_size = None
    if problem.model.specular.sees_source and radius > 0.0:
        step = RELATIVE_STEP * radius
        by_size = slope(replace(lit.cosines, source_radius_rad=radius + step), step)
    return _Slopes(
        lit=lit,
        cosines=dots(seen.normal, light.at(seen.normal)[0], seen.view),
        value=here,
        by_cosine=(slope(less_lit, -COSINE_STEP), slope(less_seen, -COSINE_STEP), slope(nearer, COSINE_STEP)),
        by_size=by_size,
    )


def _change(view: View, lights: Sequence[_Slopes], scene: Scene) -> list[Floats]:
    """Of each channel's data (n,), from a photograph's own scene to one close by."""
    cells, seen = view.cells, view.seen
    if blurred := scene.camera.blur_px2 != view.scene.camera.blur_px2:
        cells = view.gathered.blurred(scene.camera.blur_px2)
    if blurred or _place(scene) != _place(view.scene):
        seen = surface(scene.camera, scene.sphere, *cells.nodes())
    nodes: list[Floats] = [np.zeros((4, len(cells.x_px))) for _ in cells.channels]
    for before, light in zip(lights, lights_of(scene, whole=view.whole), strict=True):
        _add(nodes, before, light, seen, cells.channels)
    found = [data.told(change) for data, change in zip(cells.channels, nodes, strict=True)]
    if blurred:
        for c, (data, was, change) in enumerate(zip(cells.channels, view.cells.channels, found, strict=True)):
            here = np.sum([one.value[c] for one in lights], axis=0)
            change += data.told(here) - was.told(here)
    return found


def _place(scene: Scene) -> tuple[tuple[float, float], float]:
    return scene.sphere.centre_px, scene.sphere.radius_px


def _add(nodes: list[Floats], before: _Slopes, light: Light, seen: Surface, channels: Sequence[ChannelCells]) -> None:
    """Add to each channel's change at its nodes what comes of one light that has moved, or whose surface has."""
    towards, irradiance = light.at(seen.normal)
    colour, falloff = colour_of(light), once(irradiance[..., 0])
    moved = [there - here for there, here in zip(dots(seen.normal, towards, seen.view), before.cosines, strict=True)]
    nearer = falloff / colour[0] / once(before.lit.falloff) - 1.0
    wider = np.radians(light.angular_radius_deg) - before.lit.cosines.source_radius_rad
    for c, (data, change) in enumerate(zip(channels, nodes, strict=True)):
        for by, move in zip(before.by_cosine, moved, strict=True):
            if move.any():
                change += by[c] * _at(move, data.place)
        brighter = _at(nearer, data.place) + (colour[c] / before.lit.colour[c] - 1.0)
        if brighter.any():
            change += before.value[c] * brighter
        if before.by_size:
            change += before.by_size[c] * wider


def _at(values: Floats, place: int) -> Floats:
    """At one set of nodes of (S, 4, N); what is the same at all places is kept once."""
    return np.asarray(values[min(place, len(values) - 1)])
