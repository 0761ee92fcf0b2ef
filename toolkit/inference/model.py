"""A model of the radiance: one diffuse and one specular lobe, linear in their colours.

radiance[p, c] = sum over lights E[p, c] (albedo_c diffuse + F specular) + pedestal_c. Where the lobe wants Fresnel's
factor it is F = a + b F0, so that F0 is one more linear number: Schlick's s and 1 - s with s = (1 - cos theta_d)^5, or
the tangent of a dielectric's exact reflectance, taken anew until the F0 that it is taken at stands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np

from toolkit.geometry.sphere import surface
from toolkit.records import Floats, Light, Scene, scale_of
from toolkit.reflectance.cosines import constant
from toolkit.reflectance.fresnel import dielectric_pair, reflectance
from toolkit.reflectance.lobe import LOBES, Lobe, Parameter

from .lit import Lit

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
        return _bounds(self.parameters)

    def split(self, shape: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Shape numbers of the specular and of the diffuse lobe."""
        n = len(self.specular.parameters)
        return shape[:n], shape[n:]


@lru_cache(maxsize=256)
def _bounds(parameters: tuple[Parameter, ...]) -> tuple[Floats, Floats]:
    low, high = np.array([np.log((p.low, p.high)) if p.log else (p.low, p.high) for p in parameters]).reshape(-1, 2).T
    for bound in (low, high):
        bound.setflags(write=False)
    return low, high


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fresnel:
    """How F enters the columns.

    "none": the lobe has no F. "known": the irradiance is known, coefficient F0 with the column b and the offset a.
    "pair": unknown scale ks, coefficients ks F0 and ks. "strength": theta_d is the same all over the highlight, so
    only F(theta_d) = `reference` counts, times the unknown scale.
    """

    kind: Literal["none", "known", "pair", "strength"]
    choice: str  # of toolkit.reflectance.fresnel.FRESNEL
    cosine: float  # of theta_d at the mirror geometry of the first light
    f0: float = TYPICAL_F0  # at which a dielectric's tangent is taken

    def pair(self, lit: Lit) -> tuple[Floats | float, Floats | float]:
        """(b, a) of F = a + b F0 under one light."""
        if self.choice == "schlick":
            once = constant(lit.schlick)
            s = lit.schlick if once is None else once
            return 1 - s, s
        once = constant(lit.cosines.l_dot_h)
        b, a = dielectric_pair(lit.cosines.l_dot_h if once is None else np.array(once), self.f0)
        return (b, a) if once is None else (float(b), float(a))

    def at_mirror(self, f0: Floats | float) -> Floats:
        """F in the middle of the first light's highlight."""
        return reflectance(np.array(self.cosine), f0, self.choice)

    def slope_at_mirror(self) -> float:
        """The derivative of F in F0 there."""
        if self.choice == "schlick":
            return 1.0 - (1.0 - self.cosine) ** 5
        return float(dielectric_pair(np.array(self.cosine), self.f0)[0])


def fresnel_of(model: Model, scenes: Sequence[Scene]) -> Fresnel:
    """How F can enter: by what the scenes' lights and scale let their photographs tell."""
    cosines = [mirror_cosine(scene, light) for scene in scenes for light in scene.lights]
    choice = model.variant.get("fresnel", "schlick")
    if not model.specular.fresnel:
        return Fresnel(kind="none", choice=choice, cosine=cosines[0])
    if scale_of(scenes) == "absolute":
        return Fresnel(kind="known", choice=choice, cosine=cosines[0])
    told = np.ptp((1.0 - np.array(cosines)) ** 5) > IDENTIFYING_SPREAD
    return Fresnel(kind="pair" if told else "strength", choice=choice, cosine=cosines[0])


def mirror_normal(scene: Scene, light: Light) -> Floats:
    """The normal that halves light and view: the centre of the highlight."""
    normal = np.array([0.0, 0.0, 1.0])
    view = view_of_centre(scene)
    for _ in range(30):
        towards, _ = light.at(normal[None])
        before, normal = normal, towards[0] + view
        normal /= np.sqrt(normal @ normal)
        if np.array_equal(normal, before):
            break
    return np.asarray(normal)


def mirror_cosine(scene: Scene, light: Light) -> float:
    """The cosine of theta_d at the centre of the highlight."""
    normal = mirror_normal(scene, light)
    return float(np.clip(light.at(normal[None])[0][0] @ normal, 0.0, 1.0))


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
