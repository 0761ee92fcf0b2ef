"""Radiance of a sphere's surface points: the one equation, evaluated where it is asked for and nowhere stored."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from toolkit.geometry.sphere import centre_position, surface
from toolkit.records import Floats, Light, Scene
from toolkit.reflectance import fresnel
from toolkit.reflectance.cosines import Cosines
from toolkit.reflectance.lobe import LOBES

from .lights import point_lights
from .materials import Material


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shade:
    """What the camera sees at points of the picture; off the sphere both layers are 0."""

    diffuse: Floats  # (N, 3) radiance
    specular: Floats  # (N, 3) radiance
    on_sphere: np.ndarray  # (N,) bool
    sin2_h: Floats  # (N,) sin^2 of the normal-half angle, the smallest over the lights: 0 in a highlight's middle
    grazing: Floats  # (N,) |n.l|, the smallest over the lights: 0 where a shadow begins


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Source:
    """A light, and which of the two lobes it is seen in; `disc_rad` for a lobe that knows extended lights itself."""

    light: Light
    body: bool = True
    gloss: bool = True
    disc_rad: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Shader:
    """A material in a scene."""

    scene: Scene
    material: Material

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """The scene's lights, each extended one as several small ones, or whole where the lobe wants it whole."""
        if not LOBES[self.material.model].sees_source:
            return tuple(Source(light=light) for light in self._small(self.highlight_rad))
        whole = (
            Source(light=light, body=False, disc_rad=float(np.radians(light.angular_radius_deg)))
            for light in self.scene.lights
        )
        return tuple(Source(light=light, gloss=False) for light in self._small(detail_rad=1.0)) + tuple(whole)

    def _small(self, detail_rad: float) -> list[Light]:
        return [small for light in self.scene.lights for small in point_lights(light, detail_rad=detail_rad)]

    @cached_property
    def highlight_rad(self) -> float:
        """Half width of the specular lobe, as an angle of the normal."""
        return highlight_half_width_rad(self.material)

    @cached_property
    def irradiance(self) -> Floats:
        """Irradiance (3,) of all lights together, each on a plane facing it at the sphere's centre."""
        return np.asarray(np.sum([light.at(np.zeros((1, 3)))[1][0] for light in self.scene.lights], axis=0))

    def __call__(self, x_px: Floats, y_px: Floats) -> Shade:
        """The layers at pixel coordinates (N,)."""
        seen = surface(self.scene.camera, self.scene.sphere, x_px, y_px)
        diffuse, specular = np.zeros((2, len(x_px), 3))
        nearest, grazing = np.full((2, len(x_px)), np.inf)
        for source in self.sources:
            towards, irradiance = source.light.at(seen.normal)
            cosines = Cosines.of(seen.normal, towards, seen.view, source_radius_rad=source.disc_rad)
            if source.body:
                diffuse += irradiance * body(self.material, cosines)
            if source.gloss:
                specular += irradiance * gloss(self.material, cosines)
            nearest = np.minimum(nearest, cosines.sin2_h)
            grazing = np.minimum(grazing, np.abs(np.einsum("...i,...i->...", seen.normal, towards)))
        off = ~seen.on_sphere
        diffuse[off] = specular[off] = 0.0
        return Shade(diffuse=diffuse, specular=specular, on_sphere=seen.on_sphere, sin2_h=nearest, grazing=grazing)


def body(material: Material, cosines: Cosines) -> Floats:
    """The diffuse lobe times its colour (N, 3): radiance per irradiance on a facing plane."""
    lobe, _ = material.lobes
    return np.asarray(lobe.value(cosines, material.shape_of(lobe))[..., None] * material.colours["diffuse_albedo"])


def gloss(material: Material, cosines: Cosines) -> Floats:
    """The specular lobe times its colour (N, 3)."""
    _, lobe = material.lobes
    value = lobe.value(cosines, material.shape_of(lobe), material.variant)
    return np.asarray(value[..., None] * specular_colour(material, cosines.l_dot_h))


def specular_colour(material: Material, cosine: Floats) -> Floats:
    """The specular lobe's colour (..., 3) where cos theta_d is `cosine` (...): Fresnel's factor, or the albedo."""
    (kind, value), *_ = ((k, v) for k, v in material.colours.items() if k != "diffuse_albedo")
    if kind == "specular_f0":
        return fresnel.reflectance(np.asarray(cosine)[..., None], value, material.variant.get("fresnel", "schlick"))
    if kind == "specular_index":
        return fresnel.dielectric(np.asarray(cosine)[..., None], value)
    return np.broadcast_to(value, (*np.shape(cosine), 3))


def highlight_half_width_rad(material: Material) -> float:
    """Angle normal-half at which the specular lobe has fallen to half, seen and lit from straight above."""
    _, lobe = material.lobes
    theta = np.geomspace(1e-5, 1.0, 400)
    up = np.array([[0.0, 0.0, 1.0]])
    normal = np.stack([np.sin(theta), np.zeros_like(theta), np.cos(theta)], axis=-1)
    value = lobe.value(Cosines.of(normal, up, up), material.shape_of(lobe), material.variant)
    below = np.nonzero(value < 0.5 * value.max())[0]
    return float(theta[below[0]]) if len(below) else 1.0


def highlight_normal(scene: Scene, light: Light) -> Floats:
    """Normal (3,) in the middle of a light's highlight: it halves the directions to light and camera."""
    normal, camera = np.array([0.0, 0.0, 1.0]), scene.camera
    for _ in range(100):
        towards = light.at(normal[None])[0][0]
        view = np.array([0.0, 0.0, 1.0])
        if camera.projection == "perspective":
            view = -centre_position(camera, scene.sphere) - normal
            view /= np.linalg.norm(view)
        normal = (towards + view) / np.linalg.norm(towards + view)
    return np.asarray(normal)
