"""The answer in five seconds: body colour, gloss, reflection at the surface, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipelines.export.colour import srgb_encode, srgb_hex
from pipelines.export.material import Material
from toolkit.flags import Flag
from toolkit.inference.compare import extends
from toolkit.records import Fit, Floats, MaterialReport

from .numbers import digits, measured, percent
from .rows import degrees, elpd_difference, ranking, title

GLOSS = ((0.02, "mirror-like"), (0.08, "glossy"), (0.2, "satin"), (0.4, "dull sheen"), (math.inf, "matte"))  # by alpha
HUES = (
    (15, "red"),
    (45, "orange"),
    (70, "yellow"),
    (165, "green"),
    (200, "cyan"),
    (255, "blue"),
    (290, "violet"),
    (340, "pink"),
    (360, "red"),
)  # up to which angle of the hue, degrees
NEUTRAL = 0.08  # saturation below which no hue is seen
SCALE = (0.005, 1.0)  # the ends of the gloss scale, alpha


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the head of the page says; `place` is 0 (mirror) to 1 (matte) on the gloss scale."""

    sentence: str
    swatch: str
    swatch_note: str
    albedo: str
    gloss: str
    width: str
    place: float
    reflection: str
    reflection_exact: str
    reflection_place: float | None  # 0 (1 %) to 1 (all), where it is known as a share
    reflection_note: str
    model: str
    certainty: str
    renderer: tuple[tuple[str, str], ...]


def answer(report: MaterialReport, material: Material) -> Answer:
    """The best fit in words and a few numbers."""
    fit = report.fits[report.best]
    shine = _gloss(material, fit)
    reflection, reflection_exact = _reflection(report, fit)
    return Answer(
        sentence=_sentence(material, shine),
        swatch=srgb_hex(material.diffuse if not material.metal else material.f0),
        swatch_note=_swatch_note(report, material),
        albedo=_albedo(fit),
        gloss=shine,
        width=_width(fit),
        place=_place(material.nearest.alpha, *SCALE),
        reflection=reflection,
        reflection_exact=reflection_exact,
        reflection_place=_place(float(material.f0.mean()), 0.01, 1.0) if report.scale == "absolute" else None,
        reflection_note=_reflection_note(report, material),
        model=f"{title(fit.model)} over {title(fit.diffuse)}",
        certainty=_certainty(report),
        renderer=_renderer(material),
    )


def _place(value: float, low: float, high: float) -> float:
    """Where a value stands between two ends of a logarithmic scale, 0 to 1."""
    return min(max(math.log(max(value, low) / low) / math.log(high / low), 0.0), 1.0)


def _gloss(material: Material, fit: Fit) -> str:
    if Flag.NO_SPECULAR in fit.flags:
        return "no highlight"
    return next(word for alpha, word in GLOSS if material.nearest.alpha < alpha)


def _sentence(material: Material, shine: str) -> str:
    if shine == "no highlight":
        return f"A matte surface of {hue(material.diffuse, material)} colour: no highlight stands out from the noise."
    if material.metal:
        return f"A {shine} metal of {hue(material.f0, material)} reflection."
    return f"A {shine} surface: {hue(material.diffuse, material)} body under its highlight."


def hue(linear: Floats, material: Material) -> str:
    """The name of a linear sRGB colour's hue; "coloured" where the colours are a camera's own."""
    import colorsys

    r, g, b = srgb_encode(linear)
    turn, saturation, _ = colorsys.rgb_to_hsv(float(r), float(g), float(b))
    if saturation < NEUTRAL:
        return "neutral"
    if material.colour_space != "linear sRGB":
        return "coloured"
    return next(name for end_deg, name in HUES if 360 * turn <= end_deg)


def _swatch_note(report: MaterialReport, material: Material) -> str:
    space = "sRGB" if material.colour_space == "linear sRGB" else "the camera's own RGB: no colour matrix known"
    return space if report.scale == "absolute" else f"{space}; brightness unknown, no irradiance was given"


def _albedo(fit: Fit) -> str:
    estimate = next((p for p in fit.parameters if p.name == "diffuse_albedo"), None)
    values = fit.colours["diffuse_albedo"] if estimate is None or estimate.estimate is None else estimate.estimate
    return "  ".join(digits(float(value), 2) for value in np.ravel(np.asarray(values)))


def _width(fit: Fit) -> str:
    """The shape's first number with its sd; degrees where it is an angle."""
    for parameter in fit.parameters:
        if parameter.name in fit.shape and isinstance(parameter.estimate, float | np.floating):
            value, sd = float(parameter.estimate), None if parameter.sd is None else float(np.ravel(parameter.sd)[0])
            label = parameter.name.removesuffix("_rad").replace("_", " ")
            if parameter.unit == "rad":
                return f"{label} {degrees(value, sd)}° ± {digits(None if sd is None else math.degrees(sd), 2)}°"
            return f"{label} {measured(value, sd)} ± {digits(sd, 2)}"
    return ""


def _reflection(report: MaterialReport, fit: Fit) -> tuple[str, str]:
    """The highlight's strength, at a glance and with its sd."""
    for name in ("specular_strength", "specular_albedo"):
        found = next((p for p in fit.parameters if p.name == name and p.estimate is not None), None)
        if found is not None:
            value = float(np.mean(np.asarray(found.estimate, float)))
            sd = None if found.sd is None else float(np.mean(found.sd))
            if name == "specular_strength" and report.scale == "absolute":
                value, sd = 100 * value, None if sd is None else 100 * sd
                return f"{digits(value, 2)} %", f"{measured(value, sd)} ± {digits(sd, 2)} %"
            return digits(value, 3), f"{measured(value, sd)} ± {digits(sd, 2)}"
    return "", ""


def _reflection_note(report: MaterialReport, material: Material) -> str:
    if report.scale != "absolute":
        return "in units of the unknown scale: give the irradiance to turn it into a share"
    if material.metal:
        return "of the light is mirrored at the surface: a metal"
    return f"of the light is mirrored at the surface, as by a material of index {material.ior:.2f}"


def _certainty(report: MaterialReport) -> str:
    order = ranking(report)
    if len(order) < 2:
        return "the only model that was fitted"
    best, *others = (report.fits[index] for index in order)
    other = others[0]
    if report.preferred is not None:  # what only extends the best one by another body does not stand against it
        other = next((fit for fit in others if not extends(fit, best)), other)
    name = title(other.model) if other.diffuse == "lambert" else f"{title(other.model)} over {title(other.diffuse)}"
    lead, sd = elpd_difference(best, other)
    if report.preferred is None:
        return f"the data do not decide between it and {name}"
    if lead is None or not sd or lead >= 0.0:
        return f"preferred to {name}"
    return f"ahead of {name} by {digits(-lead, 2)} ± {digits(sd, 2)} in log predictive density"


def _renderer(material: Material) -> tuple[tuple[str, str], ...]:
    """What to type into any renderer's standard material (GGX, roughness squared is alpha)."""
    rough = digits(math.sqrt(material.ggx.alpha), 2)
    if material.metal:
        return ("base colour", srgb_hex(material.f0)), ("metallic", "1"), ("roughness", rough)
    return (
        ("base colour", srgb_hex(material.diffuse)),
        ("roughness", rough),
        ("index of refraction", f"{material.ior:.2f}"),
        ("reflects, head on", percent(float(material.f0.mean()))),
    )
