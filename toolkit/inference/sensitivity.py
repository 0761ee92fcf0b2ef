"""How the predicted radiance changes with each shift of the calibration.

Every lobe is a function of three cosines, n.l, n.v and l.v. A shift touches nothing else but the light's irradiance,
how far a blur spreads the nodes and, for a lobe that holds it, the size of the light's disc. So the lobes are
differentiated by their cosines once for all shifts, by the chain rule in normal, view and light, and every shift tells
how it moves these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Light, Scene
from toolkit.reflectance.cosines import Cosines, dot, once, parts_of

from .columns import radiance
from .descend import Projection
from .lit import Lit, lights_of, returned_on
from .moved_light import MovedLight, moved
from .nuisances import Shifts, shifted
from .problem import Optimum
from .views import View

RELATIVE_STEP = 1e-3  # of a shift's prior sd: far above rounding, far below curvature
COSINE_STEP = 1e-8  # far above rounding, far below the square of the sharpest lobe's width

Parts = Sequence[Floats]  # three components


def sensitivity(
    optimum: Optimum | Projection, told: Sequence[View], here: Sequence[View], shifts: Shifts, total: Floats
) -> tuple[Floats, ...]:
    """Per channel, the change of the predicted radiance with each shift of its photograph (n, q), by differences.

    `told` are the photographs as told, `here` the same in scenes shifted by `total`, where the change is asked for.
    """
    found: list[Floats] = []
    steps = np.diag(RELATIVE_STEP * shifts.sd)
    for v, (first, view) in enumerate(zip(told, here, strict=True)):
        mine = np.flatnonzero(shifts.photograph == v)
        slopes = [np.zeros((len(mine), len(data.rows))) for data in view.cells.channels]
        lights = [
            _slopes(optimum, view, light, lit, v)
            for light, lit in zip(lights_of(view.scene, whole=view.whole), view.lights, strict=True)
        ]
        for i, j in enumerate(mine):
            scene = shifted(first.scene, shifts, total + steps[j], v)
            for slope, change in zip(slopes, _change(view, lights, scene), strict=True):
                slope[i] = change / steps[j, j]
        found += [slope.T for slope in slopes]
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Slopes:
    """The radiance that comes of one light in each channel at its own nodes (3, 4, N), and its slopes there; those by
    a vector are three components.

    The light shines along w = d - nearness n, from its direction l = w / |w|, which has the cosines, and with an
    irradiance that falls as the square of |w|.
    """

    light: MovedLight
    towards: Parts  # l
    distance: Floats  # |w|, over that from the sphere's centre
    value: Floats
    by_w: Parts
    by_normal: Parts  # by way of w, too
    by_n_v: Floats
    by_l_v: Floats
    by_size: Floats | None  # by the angular radius of the light's disc, where the lobe holds it
    returned: Floats  # what a matte body of albedo 1 shows of what comes back from around
    body: Floats  # (3, 1, 1), the body's colour times the light's, by which that is multiplied


def _slopes(optimum: Optimum | Projection, view: View, light: Light, lit: Lit, photograph: int) -> _Slopes:
    problem, radius = optimum.problem, lit.cosines.source_radius_rad
    linear = [optimum.x[i] for i in problem.layout.index[3 * photograph : 3 * photograph + 3]]

    def value(cosines: Cosines) -> Floats:
        return np.stack(radiance(problem.model, problem.fresnel, lit.at(cosines), optimum.u, linear, view.cells))

    def slope(cosines: Cosines, step: float) -> Floats:
        there = value(cosines)
        there -= here
        there /= step
        return there

    here, seen = value(lit.cosines), view.seen
    less_lit, less_seen, nearer = lit.cosines.stepped(COSINE_STEP)
    by_n_l, by_n_v = slope(less_lit, -COSINE_STEP), slope(less_seen, -COSINE_STEP)
    by_l_v, by_size = slope(nearer, COSINE_STEP), None
    if problem.model.specular.sees_source and radius > 0.0:
        step = RELATIVE_STEP * radius
        by_size = slope(replace(lit.cosines, source_radius_rad=radius + step), step)
    normal, eye, towards = (_own(view, vectors) for vectors in (seen.normal, seen.view, light.at(seen.normal)[0]))
    now, distance = moved(light), 1.0 / np.sqrt(_own_places(view, once(lit.falloff)))
    inwards = by_n_l * dot(normal, towards) + by_l_v * dot(eye, towards) + 2.0 * here  # w turns l across itself alone
    by_w = [(by_n_l * n + by_l_v * v - inwards * to) / distance for n, v, to in zip(normal, eye, towards, strict=True)]
    by_normal = [by_n_l * to + by_n_v * v - now.nearness * w for to, v, w in zip(towards, eye, by_w, strict=True)]
    return _Slopes(
        light=now,
        towards=towards,
        distance=distance,
        value=here,
        by_w=by_w,
        by_normal=by_normal,
        by_n_v=by_n_v,
        by_l_v=by_l_v,
        by_size=by_size,
        returned=_returned(light, view, seen),
        body=np.array([own[0] * colour for own, colour in zip(linear, lit.colour, strict=True)])[:, None, None],
    )


def _change(view: View, lights: Sequence[_Slopes], scene: Scene) -> list[Floats]:
    """Of each channel's data (n,), from a photograph's own scene to one close by."""
    cells, there = view.cells, None
    if blurred := scene.camera.blur_px2 != view.scene.camera.blur_px2:
        cells = view.gathered.blurred(scene.camera.blur_px2)
    if blurred or _place(scene) != _place(view.scene):
        there = surface(scene.camera, scene.sphere, *cells.nodes())
    nodes = np.zeros((3, 4, len(cells.x_px)))
    for before, light in zip(lights, lights_of(scene, whole=view.whole), strict=True):
        _add(nodes, before, moved(light), view, there)
    found = [data.told(change) for data, change in zip(cells.channels, nodes, strict=True)]
    if blurred:
        here = np.sum([one.value for one in lights], axis=0)
        for data, was, change, values in zip(cells.channels, view.cells.channels, found, here, strict=True):
            change += data.told(values) - was.told(values)
    return found


def _place(scene: Scene) -> tuple[tuple[float, float], float]:
    return scene.sphere.centre_px, scene.sphere.radius_px


def _add(nodes: Floats, before: _Slopes, light: MovedLight, view: View, there: Surface | None) -> None:
    """Add to the channels' changes at their nodes what comes of one light that has moved, or whose surface has."""
    normal, eye = _own(view, view.seen.normal), _own(view, view.seen.view)
    turned = _less(light.direction, before.light.direction)
    if any(turned):
        nodes += dot(before.by_w, turned)
    if nearer := light.nearness - before.light.nearness:
        nodes -= nearer * dot(before.by_w, normal)
    if there is not None:
        nodes += dot(before.by_normal, _less(_own(view, there.normal), normal))
        aside = _less(_own(view, there.view), eye)
        if any(part.any() for part in aside):
            nodes += before.by_n_v * dot(normal, aside) + before.by_l_v * dot(before.towards, aside)
    brighter = np.divide(light.colour, before.light.colour) - 1.0
    if brighter.any():
        nodes += before.value * brighter[:, None, None]
    more = _returned(light, view, view.seen if there is None else there) - before.returned
    if more.any():
        nodes += before.body * more / before.distance**2
    if before.by_size is not None:
        nodes += before.by_size * np.radians(light.angular_radius_deg - before.light.angular_radius_deg)


def _returned(light: Light, view: View, seen: Surface) -> Floats:
    back = returned_on(light, seen)
    return np.zeros((1, 1, 1)) if back is None else _own_places(view, back)


def _own(view: View, vectors: Floats) -> Parts:
    """The components of vectors (S, 4, N, 3) at each channel's own nodes (3, 4, N), or once where all are the same."""
    return [_own_places(view, part) for part in parts_of(vectors)]


def _own_places(view: View, values: Floats) -> Floats:
    places = [data.place for data in view.cells.channels]
    return values if len(values) == 1 or places == list(range(len(values))) else values[places]


def _less(after: Sequence[Any], before: Sequence[Any]) -> list[Any]:
    return [a - b for a, b in zip(after, before, strict=True)]
