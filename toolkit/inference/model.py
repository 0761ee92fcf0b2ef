"""A model of the radiance: one diffuse and one specular lobe, linear in their colours, and its columns on the cells.

radiance[p, c] = sum over lights E[p, c] (albedo_c diffuse + F specular) + pedestal_c, with F by Schlick where the
lobe wants it: F0 (1 - s) + s, s = (1 - cos theta_d)^5, so that F0 is one more linear number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from toolkit.geometry.sphere import Surface, surface
from toolkit.records import Floats, Light, Scene
from toolkit.reflectance.cosines import Cosines
from toolkit.reflectance.lobe import LOBES, Lobe, Parameter

from .cells import Cells, ChannelCells

IDENTIFYING_SPREAD = 0.02  # spread of Schlick's s over the highlights from which F0 and strength come apart
TYPICAL_F0 = 0.04  # of a dielectric of index 1.5; shapes F(theta_d) where F0 itself is not identified


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """Which lobes, which variants of them, and whether the specular colour is one number or three."""

    specular: Lobe
    diffuse: Lobe
    variant: Mapping[str, str] = field(default_factory=dict)
    neutral: bool = False

    @classmethod
    def named(
        cls, specular: str, diffuse: str = "lambert", variant: Mapping[str, str] | None = None, *, neutral: bool = False
    ) -> Model:
        """From the lobes' names; raises KeyError on an unknown one, ValueError on an unknown variant."""
        lobe = LOBES[specular]
        return cls(specular=lobe, diffuse=LOBES[diffuse], variant=lobe.complete(variant), neutral=neutral)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The shape's parameters: the specular lobe's, then the diffuse lobe's."""
        return self.specular.parameters + self.diffuse.parameters

    def natural(self, u: Floats) -> tuple[float, ...]:
        """Shape numbers from the coordinates in which they are searched and sampled."""
        return tuple(float(np.exp(v)) if p.log else float(v) for p, v in zip(self.parameters, u, strict=True))

    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of the coordinates."""
        low = np.array([np.log(p.low) if p.log else p.low for p in self.parameters])
        return low, np.array([np.log(p.high) if p.log else p.high for p in self.parameters])

    def split(self, shape: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Shape numbers of the specular and of the diffuse lobe."""
        n = len(self.specular.parameters)
        return shape[:n], shape[n:]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lit:
    """What one light does at surface points: cosines (...), irradiance as colour (3,) x falloff (...), Schlick's s."""

    cosines: Cosines
    colour: Floats
    falloff: Floats
    schlick: Floats


def lit_by(scene: Scene, x_px: Floats, y_px: Floats) -> tuple[Lit, ...]:
    """The geometry of every light at pixel coordinates of any shape."""
    seen = surface(scene.camera, scene.sphere, x_px, y_px)
    return tuple(_lit(light, seen) for light in scene.lights)


def _lit(light: Light, seen: Surface) -> Lit:
    towards, irradiance = light.at(seen.normal)
    colour = light.at(np.zeros((1, 3)))[1][0]  # at the sphere's centre
    cosines = Cosines.of(seen.normal, towards, seen.view, source_radius_rad=float(np.radians(light.angular_radius_deg)))
    return Lit(
        cosines=cosines,
        colour=np.asarray(colour),
        falloff=irradiance[..., 0] / colour[0],
        schlick=np.asarray((1.0 - cosines.l_dot_h) ** 5),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fresnel:
    """How F enters the columns.

    "none": the lobe has no F. "known": the irradiance is known, coefficient F0 with the column (1 - s) and the
    offset s. "pair": unknown scale ks, coefficients ks F0 and ks. "strength": s is the same all over the highlight,
    so only F(theta_d) = `reference` counts, times the unknown scale.
    """

    kind: str
    reference_s: float  # Schlick's s at the mirror geometry of the brightest light


def fresnel_of(model: Model, scene: Scene) -> Fresnel:
    """How F can enter: by what the scene's lights and scale let a photograph tell."""
    at_mirror = [mirror_schlick(scene, light) for light in scene.lights]
    if not model.specular.fresnel:
        return Fresnel(kind="none", reference_s=at_mirror[0])
    if scene.scale == "absolute":
        return Fresnel(kind="known", reference_s=at_mirror[0])
    kind = "pair" if np.ptp(at_mirror) > IDENTIFYING_SPREAD else "strength"
    return Fresnel(kind=kind, reference_s=at_mirror[0])


def mirror_normal(scene: Scene, light: Light) -> Floats:
    """The normal that halves light and view: the centre of the highlight."""
    normal = np.array([0.0, 0.0, 1.0])
    view = view_of_centre(scene)
    for _ in range(30):
        towards, _ = light.at(normal[None])
        normal = towards[0] + view
        normal /= np.linalg.norm(normal)
    return np.asarray(normal)


def mirror_schlick(scene: Scene, light: Light) -> float:
    """Schlick's s at the centre of the highlight."""
    normal = mirror_normal(scene, light)
    return float((1.0 - light.at(normal[None])[0][0] @ normal) ** 5)


def view_of_centre(scene: Scene) -> Floats:
    """Unit vector from the sphere's centre towards the camera."""
    x, y = scene.sphere.centre_px
    return np.asarray(surface(scene.camera, scene.sphere, np.array([x]), np.array([y])).view[0])


def names_of(model: Model, fresnel: Fresnel) -> tuple[str, ...]:
    """Names of a channel's linear coefficients, in the order of the columns."""
    specular = {
        "none": ("specular_albedo",),
        "known": ("specular_f0",),
        "pair": ("specular_scale_f0", "specular_scale"),
        "strength": ("specular_strength",),
    }[fresnel.kind]
    return ("diffuse_albedo", *specular, "pedestal")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """One channel's columns (n, k) on its cells, the part of the prediction with a known coefficient, derivatives."""

    matrix: Floats
    offset: Floats
    d_matrix: tuple[Floats, ...] = ()  # one (n, k) per shape number, in the searched coordinate
    d_offset: tuple[Floats, ...] = ()


def columns(
    model: Model, fresnel: Fresnel, lights: tuple[Lit, ...], cells: Cells, u: Floats, *, derivatives: bool = False
) -> tuple[Columns, Columns, Columns]:
    """The columns of all three channels at one shape; `lights` are those of the cells' nodes (4, N)."""
    shape = model.natural(u)
    sharp, soft = model.split(shape)
    tables = [[_terms(lit, fresnel, *_Lobes(lit).value(model, sharp, soft)) for lit in lights]]
    if derivatives:
        gradients = [_Lobes(lit).gradient(model, sharp, soft) for lit in lights]
        for j, (number, p) in enumerate(zip(shape, model.parameters, strict=True)):
            factor = number if p.log else 1.0
            tables.append(
                [
                    _terms(lit, fresnel, *(factor * part for part in g[j]))
                    for lit, g in zip(lights, gradients, strict=True)
                ]
            )
    colours = [lit.colour for lit in lights]
    red, green, blue = (_channel(tables, colours, data, c) for c, data in enumerate(cells.channels))
    return red, green, blue


def _channel(tables: list[list[list[Floats]]], colours: list[Floats], data: ChannelCells, channel: int) -> Columns:
    """One channel's columns: each term's weighted mean over the cells' nodes, summed over the lights."""
    here = data.rows if len(data.rows) < tables[0][0][0].shape[1] else slice(None)  # all of them: no copy
    mixed = [
        [
            np.asarray(
                sum(
                    colour[channel] * np.einsum("kn,kn->n", data.weights, term[:, here])
                    for colour, term in zip(colours, terms, strict=True)
                )
            )
            for terms in zip(*table, strict=True)
        ]
        for table in tables
    ]
    ones = np.ones(len(data.rows))
    return Columns(
        matrix=np.stack([*mixed[0][1:], ones], axis=1),
        offset=mixed[0][0],
        d_matrix=tuple(np.stack([*m[1:], 0.0 * ones], axis=1) for m in mixed[1:]),
        d_offset=tuple(m[0] for m in mixed[1:]),
    )


@dataclass(frozen=True, slots=True)
class _Lobes:
    """The two lobes under one light: (diffuse, specular) and their derivatives."""

    lit: Lit

    def value(self, model: Model, sharp: tuple[float, ...], soft: tuple[float, ...]) -> tuple[Floats, Floats]:
        cosines = self.lit.cosines
        return model.diffuse.value(cosines, soft), model.specular.value(cosines, sharp, model.variant)

    def gradient(self, model: Model, sharp: tuple[float, ...], soft: tuple[float, ...]) -> list[tuple[Floats, Floats]]:
        cosines = self.lit.cosines
        zero = np.zeros_like(cosines.n_dot_l)
        specular = [(zero, g) for g in model.specular.derivative(cosines, sharp, model.variant)]
        return specular + [(g, zero) for g in model.diffuse.derivative(cosines, soft)]


def _terms(lit: Lit, fresnel: Fresnel, diffuse: Floats, specular: Floats) -> list[Floats]:
    """At the nodes (4, N): what has a known coefficient first, then one table for each coefficient."""
    diffuse, specular, s = diffuse * lit.falloff, specular * lit.falloff, lit.schlick
    nothing = np.zeros_like(diffuse)
    if fresnel.kind == "none":
        return [nothing, diffuse, specular]
    if fresnel.kind == "strength":
        ratio = (TYPICAL_F0 + (1 - TYPICAL_F0) * s) / (TYPICAL_F0 + (1 - TYPICAL_F0) * fresnel.reference_s)
        return [nothing, diffuse, specular * ratio]
    if fresnel.kind == "known":
        return [specular * s, diffuse, specular * (1 - s)]
    return [nothing, diffuse, specular * (1 - s), specular * s]
