"""The best fit in the words that renderers share: body colour, reflectance at normal incidence, microfacet width."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.records import Fit, Floats, MaterialReport, readonly
from toolkit.reflectance import LOBES

from .equivalent import Equivalent, equivalents

METAL_F0 = 0.15  # no common dielectric reflects as much (diamond 0.17)
METAL_BODY = 0.02  # and no metal has a body colour
TYPICAL_F0 = 0.04  # index 1.5: paint, plastic, glaze


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """What an exporter writes; `notes` say in words what was assumed and what is lost."""

    name: str  # letters, digits, underscores
    source: str  # the photograph's name, harmless characters only
    sha256: str
    model: str
    diffuse_model: str
    diffuse: Floats  # (3,) albedo, 0 .. 1
    diffuse_roughness_rad: float
    f0: Floats  # (3,) reflectance at normal incidence, 0 .. 1
    beckmann: Equivalent
    ggx: Equivalent
    metal: bool
    colour_space: str  # "linear sRGB" or "camera RGB"
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def nearest(self) -> Equivalent:
        """Of the two distributions the one nearer to the fit."""
        return min(self.beckmann, self.ggx, key=lambda one: one.misfit)

    @property
    def ior(self) -> float:
        """The index of refraction whose reflectance at normal incidence is the brightest channel's F0, 1 to 3."""
        root = float(np.sqrt(min(self.f0.max(), 0.25)))
        return (1.0 + root) / (1.0 - root)


def material_of(report: MaterialReport) -> Material:
    """The best fit as a renderer's material."""
    from pipelines.report.text import base_name, stem

    fit = report.fits[report.best]
    half_angle_rad, schlick = _highlight(fit)
    near = _equivalents(fit, half_angle_rad)
    diffuse, f0, notes = _scaled(report, *_balanced(report, *_colours(fit, near["ggx"].gain, schlick)))
    metal = bool(diffuse.max() < METAL_BODY and f0.mean() > METAL_F0)
    diffuse, f0, space, about = _in_srgb(report, diffuse, f0)
    return Material(
        name="".join(c if c.isascii() and c.isalnum() else "_" for c in stem(report.image.name)) or "material",
        source="".join(c for c in base_name(report.image.name) if c.isascii() and (c.isalnum() or c in "._ ()")),
        sha256="".join(c for c in report.image.sha256 if c in "0123456789abcdef"),
        model=fit.model,
        diffuse_model=fit.diffuse,
        diffuse=diffuse,
        diffuse_roughness_rad=fit.shape["diffuse_roughness_rad"] if fit.diffuse == "oren-nayar" else 0.0,
        f0=f0,
        beckmann=near["beckmann"],
        ggx=near["ggx"],
        metal=metal,
        colour_space=space,
        notes=(*_lost(fit, near), *notes, about),
    )


def _equivalents(fit: Fit, half_angle_rad: float) -> dict[str, Equivalent]:
    """Both of one amplitude: 1 where the fitted lobe is a microfacet one, whose F0 is to stay what it is."""
    gain = 1.0
    if not LOBES[fit.model].fresnel:
        free = equivalents(fit.model, fit.shape, fit.variant, half_angle_rad=half_angle_rad)
        gain = min(free.values(), key=lambda one: one.misfit).gain
    return equivalents(fit.model, fit.shape, fit.variant, half_angle_rad=half_angle_rad, gain=gain)


def _highlight(fit: Fit) -> tuple[float, float]:
    """Half the angle between light and view where the highlight stands (rad), and Schlick's (1 - cos)^5 there."""
    from toolkit.inference.model import mirror_cosine

    cosine = mirror_cosine(fit.scene, fit.scene.lights[0])
    return float(np.arccos(cosine)), (1.0 - cosine) ** 5


def _colours(fit: Fit, gain: float, schlick: float) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Body albedo and F0 (3,) of the lobe that stands in for the fitted one."""
    mean = {p.name: p.estimate for p in fit.parameters if p.estimate is not None}
    diffuse = _colour(mean.get("diffuse_albedo", fit.colours["diffuse_albedo"]))
    strength = mean.get("specular_strength", fit.colours.get("specular_strength"))
    if strength is None:
        strength = mean.get("specular_albedo", fit.colours["specular_albedo"])
    f0 = (gain * _colour(strength) - schlick) / (1.0 - schlick)
    known = mean.get("specular_f0")
    if known is not None and np.isfinite(_colour(known)).all():
        return diffuse, gain * _colour(known), ()
    note = (
        "F0 is read off the highlight's strength as if the irradiance were known: this photograph alone does not fix it"
    )
    return diffuse, np.maximum(f0, 0.0), (note,)


def _colour(value: object) -> Floats:
    return np.broadcast_to(np.asarray(value, float), (3,)).copy()


def _balanced(
    report: MaterialReport, diffuse: Floats, f0: Floats, notes: tuple[str, ...]
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Where no irradiance was given the light's colour is still in both; it is divided out."""
    from pipelines.srgb import neutralised

    return neutralised(report, diffuse), neutralised(report, f0), notes


def _scaled(
    report: MaterialReport, diffuse: Floats, f0: Floats, notes: tuple[str, ...]
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Where the scale is unknown, the one at which the highlight is that of a dielectric of index 1.5."""
    if report.scale == "absolute":
        return diffuse, f0, notes
    scale = max(float(f0.mean()) / TYPICAL_F0, float(diffuse.max()) / 0.9, 1e-9)
    note = (
        f"the scale is unknown: colours are divided by {scale:.4g}, as if F0 were 0.04 (index 1.5), albedo at most 0.9"
    )
    return diffuse / scale, f0 / scale, (note,)


def _in_srgb(report: MaterialReport, diffuse: Floats, f0: Floats) -> tuple[Floats, Floats, str, str]:
    if report.colour is None:
        about = "colours are the camera's own red, green and blue: the file carries no colour matrix"
        return np.clip(diffuse, 0, 1), np.clip(f0, 0, 1), "camera RGB", about
    body, gloss = report.colour.to_srgb @ diffuse, report.colour.to_srgb @ f0
    how = "a colour chart" if report.colour.source == "chart" else "the file's colour matrix"
    about = f"colours are linear sRGB, from the camera's by {how}"
    if min(body.min(), gloss.min()) < 0.0 or max(body.max(), gloss.max()) > 1.0:
        about += "; what lies outside 0 .. 1 is clipped"
    return np.clip(body, 0, 1), np.clip(gloss, 0, 1), "linear sRGB", about


def _lost(fit: Fit, near: Mapping[str, Equivalent]) -> tuple[str, ...]:
    notes = []
    if fit.model not in near or fit.variant.get("masking", "smith") != "smith":
        fitted = ", ".join(f"{name} {fit.shape[name]:.5g}" for name in sorted(fit.shape))
        told = "; ".join(
            f"{one.distribution} alpha {one.alpha:.4g} misses by {one.misfit:.1%}" for one in near.values()
        )
        notes.append(
            f"fitted was {fit.model} ({fitted}); nearest lobes with Smith masking: {told} rms of the highlight"
        )
    if fit.diffuse not in ("lambert", "oren-nayar"):
        notes.append(f"the body lobe {fit.diffuse} is replaced by Lambert's")
    return tuple(notes)
