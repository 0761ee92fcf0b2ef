"""The data dictionary of the batch's tables: every column's unit and meaning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .rows import CHANNELS, PARTS, Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column; `kind` is "text", "number", "whole" or "yes/no"."""

    name: str
    unit: str
    kind: str
    meaning: str


def _of(name: str, unit: str, kind: str, meaning: str) -> Column:
    return Column(name=name, unit=unit, kind=kind, meaning=meaning)


FIXED = (
    _of(
        "photograph",
        "",
        "text",
        "the photograph as it was named; all of a joint fit, which is told of by the first below",
    ),
    _of("place", "", "text", "folder of its result, below the batch's"),
    _of("material", "", "text", "what it shows, as the manifest or --material says"),
    _of("group", "", "text", "the group that was fitted jointly"),
    _of("status", "", "text", "done or failed"),
    _of("error", "", "text", "why it failed"),
    _of("flags", "", "text", "what a reader must know, separated by spaces"),
    _of("outlier", "", "yes/no", "farther from the material's other photographs than chance allows (5 % a batch)"),
    _of("camera", "", "text", "maker and model"),
    _of("sha256", "", "text", "SHA-256 of the photograph"),
    _of("width_px", "px", "whole", "the photograph's width"),
    _of("height_px", "px", "whole", "the photograph's height"),
    _of(
        "scale",
        "",
        "text",
        "absolute, or relative where no irradiance was given: albedos in units of the unknown scale",
    ),
    _of("centre_x_px", "px", "number", "where the sphere's centre projects, to the right of the first pixel's centre"),
    _of("centre_y_px", "px", "number", "where the sphere's centre projects, below the first pixel's centre"),
    _of("radius_px", "px", "number", "the sphere's radius"),
    _of("lights", "", "whole", "how many lights"),
    _of("light_x", "1", "number", "unit direction to the first light, fitted: to the right"),
    _of("light_y", "1", "number", "unit direction to the first light, fitted: up"),
    _of("light_z", "1", "number", "unit direction to the first light, fitted: to the camera"),
    _of("angle_deg", "deg", "number", "angle between body and light colour, by colour alone"),
    _of("alpha_ggx", "1", "number", "width of the nearest GGX lobe, a scale that all models share"),
    _of("strength_ggx", "1", "number", "strength of that lobe, mean of the channels"),
    _of("swatch", "sRGB", "text", "the body's colour (a metal's reflection) on a screen"),
    _of("model", "", "text", "the best fit's specular lobe"),
    _of("variant", "", "text", "and its variant"),
    _of("diffuse", "", "text", "the best fit's diffuse lobe"),
    _of("preferred", "", "yes/no", "whether the data prefer the best fit to all others"),
    _of("chi2_reduced", "1", "number", "misfit over measurement noise alone; 1 is perfect"),
    _of("elpd", "nat", "number", "expected log predictive density, over blocks of the surface; larger is better"),
    _of("elpd_lead", "nat", "number", "the best fit's elpd over the runner-up's"),
    _of("elpd_lead_sd", "nat", "number", "sd of that"),
)
MEANING = {
    "diffuse_albedo": "share of the light that the body scatters back",
    "reflectance_factor": "the body beside a perfect white diffuser, lit at 45 deg, seen at 0 deg",
    "specular_albedo": "the highlight's peak per unit of irradiance",
    "specular_strength": "share of the light mirrored where the highlight stands",
    "specular_f0": "share mirrored along the normal",
    "pedestal": "light that reaches every pixel alike",
}
SAID = {"": "posterior mean", "_sd": "posterior sd", "_low90": "low end of 90 %", "_high90": "high end of 90 %"}
COLOURS = {"r": "red", "g": "green", "b": "blue"}


def columns(rows: Iterable[Row]) -> list[Column]:
    """The fixed columns, then those of every parameter that some best fit has, in the register's order."""
    fixed = {column.name for column in FIXED}
    found = {name for row in rows for name in row.cells if name not in fixed}
    order = {
        column.name: column for name, unit, meaning in parameters() for column in _of_parameter(name, unit, meaning)
    }
    others = [_of(name, "", "number", "a parameter of the best fit") for name in sorted(found - set(order))]
    return [*FIXED, *(column for name, column in order.items() if name in found), *others]


def parameters() -> Sequence[tuple[str, str, str]]:
    """Name, unit and meaning of every parameter that a fit can have."""
    from toolkit.reflectance import LOBES

    own = {p.name: (p.unit, p.meaning) for lobe in LOBES.values() for p in lobe.parameters}
    colours = {name: ("image units" if name == "pedestal" else "1", meaning) for name, meaning in MEANING.items()}
    return [(name, unit or "1", meaning) for name, (unit, meaning) in {**own, **colours}.items()]


def _of_parameter(name: str, unit: str, meaning: str) -> list[Column]:
    plain = [_of(f"{name}{part}", unit, "number", f"{meaning}: {SAID[part]}") for part in PARTS]
    coloured = [
        _of(f"{name}_{channel}{part}", unit, "number", f"{meaning}, {COLOURS[channel]}: {SAID[part]}")
        for channel in CHANNELS
        for part in PARTS
    ]
    return [*plain, *coloured]


POOLED = (
    _of("material", "", "text", "its name"),
    _of("photographs", "", "whole", "photographs of it, failed ones too"),
    _of("model", "", "text", "specular lobe: of those fitted to all, the one with the largest summed elpd"),
    _of("variant", "", "text", "and its variant"),
    _of("diffuse", "", "text", "diffuse lobe"),
    _of("parameter", "", "text", "what is pooled"),
    _of("channel", "", "text", "r, g or b; empty where there is one number"),
    _of("unit", "", "text", "of all numbers of the row"),
    _of("count", "", "whole", "photographs that determine it"),
    _of("mean", "row", "number", "pooled over the photographs, random effects"),
    _of("sd", "row", "number", "of the mean (Hartung-Knapp, never narrower than without)"),
    _of("low95", "row", "number", "low end of the mean's 95 %"),
    _of("high95", "row", "number", "high end of the mean's 95 %"),
    _of("scatter", "row", "number", "sd between photographs beyond each one's own error (REML)"),
    _of("scatter_sd", "row", "number", "its own sd"),
    _of("scatter_low95", "row", "number", "low end of its 95 % (Q-profile)"),
    _of("scatter_high95", "row", "number", "high end of its 95 % (Q-profile)"),
    _of("scatter_moments", "row", "number", "the same by moments (DerSimonian-Laird)"),
    _of("expect_low95", "row", "number", "where a further photograph's value would lie, low end of 95 %"),
    _of("expect_high95", "row", "number", "where a further photograph's value would lie, high end of 95 %"),
    _of("typical_sd", "row", "number", "one photograph's own sd, typically"),
    _of("i2", "1", "number", "share of the variance seen that is scatter between photographs"),
    _of("q", "1", "number", "Cochran's Q"),
    _of("q_p", "1", "number", "chance of as much disagreement without any scatter"),
    _of("outliers", "", "whole", "photographs farther from the others than chance allows"),
)
