"""What the lights do at surface points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Light, Scene
from toolkit.reflectance.blockwise import Piece
from toolkit.reflectance.cosines import Cosines, per_place
from toolkit.reflectance.fresnel import schlick_pair

from .moved_light import parts, returned_of


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lit:
    """What one light does at surface points: cosines (...), irradiance as colour (3,) x falloff (...), Schlick's s.

    `returned` (...) as by `returned_on`.
    """

    cosines: Cosines
    colour: Floats
    falloff: Floats
    schlick: Floats
    returned: Floats | None

    def thinned(self, every: int) -> Lit:
        """At one place in so many along the last axis, these together in memory."""

        def piece(values: Floats) -> Floats:
            few = values[..., ::every]
            return np.ascontiguousarray(few) if any(few.strides) else few

        return self._each(piece)

    def middles(self) -> Lit:
        """Means over the last axis but one, of nodes, in their place."""

        def piece(values: Floats) -> Floats:
            nodes = values.shape[-2]
            return np.full((1, nodes), 1.0 / nodes) @ values if any(values.strides) else values[..., :1, :]

        return self._each(piece)

    def _each(self, piece: Piece) -> Lit:
        return replace(
            self,
            cosines=self.cosines.part(piece),
            falloff=piece(self.falloff),
            schlick=piece(self.schlick),
            returned=None if self.returned is None else piece(self.returned),
        )

    def at(self, cosines: Cosines) -> Lit:
        """The same light at other cosines."""
        return replace(self, cosines=cosines, schlick=_schlick(cosines))


def lit_by(scene: Scene, x_px: Floats, y_px: Floats, *, whole: bool = False) -> tuple[Lit, ...]:
    """The geometry of every light at pixel coordinates of any shape; a sized one in parts, unless `whole`."""
    return lit_on(scene, surface(scene.camera, scene.sphere, x_px, y_px), whole=whole)


def lit_on(scene: Scene, seen: Surface, *, whole: bool = False) -> tuple[Lit, ...]:
    """The same on a surface that is worked out already."""
    return tuple(_lit(light, seen) for light in lights_of(scene, whole=whole))


def lights_of(scene: Scene, *, whole: bool = False) -> tuple[Light, ...]:
    """A scene's lights; a sized one in parts, unless `whole`."""
    return tuple(small for light in scene.lights for small in ((light,) if whole else parts(light)))


def _lit(light: Light, seen: Surface) -> Lit:
    towards, irradiance = light.at(seen.normal)
    colour = colour_of(light)
    cosines = Cosines.of(seen.normal, towards, seen.view, source_radius_rad=float(np.radians(light.angular_radius_deg)))
    return Lit(
        cosines=cosines,
        colour=colour,
        falloff=per_place(irradiance[..., 0], lambda e: e / float(colour[0])),
        schlick=_schlick(cosines),
        returned=returned_on(light, seen),
    )


def returned_on(light: Light, seen: Surface) -> Floats | None:
    """What a matte body of albedo 1 shows (...) of what comes back of a light from around; None: nothing does."""
    back = returned_of(light)
    return np.asarray(seen.normal @ np.array(back, seen.normal.dtype) / np.pi) if any(back) else None


def _schlick(cosines: Cosines) -> Floats:
    return per_place(cosines.l_dot_h, lambda cosine: schlick_pair(cosine)[1])


def colour_of(light: Light) -> Floats:
    """Its irradiance at the sphere's centre (3,)."""
    return np.asarray(light.at(np.zeros((1, 3)))[1][0])
