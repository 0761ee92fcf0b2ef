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
from toolkit.reflectance.cosines import Cosines, dot, dots, once, parts_of

from .columns import radiance
from .descend import Projection
from .lit import Lit, colour_of, lights_of, returned_on
from .moved_light import MovedLight, moved
from .nuisances import Shifts, shifted
from .problem import Optimum
from .views import View

RELATIVE_STEP = 1e-3  # of a shift's prior sd: far above rounding, far below curvature
COSINE_STEP = 1e-8  # far above rounding, far below the square of the sharpest lobe's width

Parts = tuple[Floats, Floats, Floats]


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
    """One light's geometry at the nodes of all places (S, 4, N), or once where it is the same everywhere; and the
    radiance that comes of it in each channel at its own nodes (3, 4, N), with its slopes there.
    """

    light: MovedLight
    towards: Parts  # to the light
    distance: Floats  # of it, over that from the sphere's centre
    cosines: Parts  # n.l, n.v and l.v, not clipped
    value: Floats
    by_cosine: Parts  # by n.l, n.v and l.v
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
    towards, _ = light.at(seen.normal)
    less_lit, less_seen, nearer = lit.cosines.stepped(COSINE_STEP)
    by_size = None
    if problem.model.specular.sees_source and radius > 0.0:
        step = RELATIVE_STEP * radius
        by_size = slope(replace(lit.cosines, source_radius_rad=radius + step), step)
    return _Slopes(
        light=moved(light),
        towards=parts_of(towards),
        distance=1.0 / np.sqrt(once(lit.falloff)),
        cosines=dots(seen.normal, towards, seen.view),
        value=here,
        by_cosine=(slope(less_lit, -COSINE_STEP), slope(less_seen, -COSINE_STEP), slope(nearer, COSINE_STEP)),
        by_size=by_size,
        returned=_returned(light, seen),
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
    places = [data.place for data in view.cells.channels]

    def own(values: Floats) -> Floats:
        return values if len(values) == 1 or places == list(range(len(values))) else values[places]

    *moves, nearer = (own(change) for change in _moves(before, light, view.seen, there))
    for by, move in zip(before.by_cosine, moves, strict=True):
        if move.any():
            nodes += by * move
    brighter = nearer + (colour_of(light) / colour_of(before.light) - 1.0)[:, None, None]
    if brighter.any():
        nodes += before.value * brighter
    more = _returned(light, view.seen if there is None else there) - before.returned
    if more.any():
        nodes += before.body * own(more / before.distance**2)
    if before.by_size is not None:
        nodes += before.by_size * np.radians(light.angular_radius_deg - before.light.angular_radius_deg)


def _returned(light: Light, seen: Surface) -> Floats:
    back = returned_on(light, seen)
    return np.zeros((1, 1, 1)) if back is None else back


def _moves(before: _Slopes, light: MovedLight, seen: Surface, there: Surface | None) -> list[Floats]:
    """Changes of n.l, n.v and l.v, and of the irradiance by the light's distance as a share of it.

    l is the direction of w = d - nearness n, of the length `distance`, and turns by what dw has across it.
    """
    (n_l, n_v, l_v), towards = before.cosines, before.towards
    normal, eye = parts_of(seen.normal), parts_of(seen.view)
    nearer = light.nearness - before.light.nearness
    by_l, by_n, by_v = -nearer * n_l, np.full((1, 1, 1), -nearer), -nearer * n_v  # of dw with l, n and v
    step = [a - b for a, b in zip(light.direction, before.light.direction, strict=True)]
    if any(step):
        by_l, by_n, by_v = by_l + dot(towards, step), by_n + dot(normal, step), by_v + dot(eye, step)
    lit: Floats
    viewed: Floats
    across: Floats
    lit, viewed, across = np.zeros((3, 1, 1, 1))
    if there is not None:
        turned = [a - b for a, b in zip(parts_of(there.normal), normal, strict=True)]
        aside = [a - b for a, b in zip(parts_of(there.view), eye, strict=True)]
        lit, viewed = dot(turned, towards), dot(turned, eye)
        by_l, by_v = by_l - before.light.nearness * lit, by_v - before.light.nearness * viewed
        if any(part.any() for part in aside):
            viewed, across = viewed + dot(normal, aside), dot(towards, aside)
    far = 1.0 / before.distance
    return [lit + far * (by_n - by_l * n_l), viewed, across + far * (by_v - by_l * l_v), -2.0 * far * by_l]
