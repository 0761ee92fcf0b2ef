"""The tables of the page, as rows of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipelines.srgb import Srgb, srgb_of
from toolkit.flags import MEANING, Flag
from toolkit.inference.compare import difference
from toolkit.records import Estimate, Fit, MaterialReport
from toolkit.reflectance import LOBES

from .numbers import MISSING, digits, measured
from .text import clean

COLOURS = {
    "diffuse_albedo": "share of the light that the body scatters back, by channel",
    "reflectance_factor": "the body beside a perfect white diffuser, lit at 45°, seen at 0°: one quantity for all "
    "diffuse models",
    "specular_strength": "share of the light mirrored where the highlight stands (Fresnel's factor times the scale)",
    "specular_f0": "share mirrored when light and view are both along the normal",
    "specular_albedo": "the highlight's peak per unit of irradiance",
    "pedestal": "light that reaches every pixel alike: flare, black level",
}
CHANNELS = ("R", "G", "B")


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """One channel's numbers of one parameter; `degrees` under each where the unit is the radian."""

    channel: str
    estimate: str
    sd: str
    sd_statistical: str
    interval_68: str
    interval_90: str
    to_prior: str
    degrees: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """One parameter of one fit."""

    name: str
    title: str
    meaning: str
    unit: str
    note: str
    srgb: str  # linear sRGB, where the camera's colours are known
    swatch: str  # and as #rrggbb, where the scale is as well
    channels: tuple[Cells, ...]


def parameter_rows(report: MaterialReport, fit: Fit) -> list[ParameterRow]:
    """Every parameter of a fit."""
    return [_parameter(fit, parameter, srgb_of(report, fit, parameter)) for parameter in fit.parameters]


def _parameter(fit: Fit, parameter: Estimate, srgb: Srgb | None) -> ParameterRow:
    shape = {p.name: p for lobe in (fit.model, fit.diffuse) if lobe in LOBES for p in LOBES[lobe].parameters}
    own = shape.get(parameter.name)
    common = parameter.name.rstrip("0123456789").removesuffix("_") if _numbered(parameter.name) else parameter.name
    meaning = f"{own.meaning}; {own.typical}" if own else COLOURS.get(common, "")
    width = np.size(parameter.estimate) if parameter.estimate is not None else 1
    return ParameterRow(
        name=parameter.name,
        title=parameter.name.removesuffix("_rad").replace("_", " ").replace("f0", "F0"),
        meaning=meaning,
        unit="" if parameter.unit == "1" else parameter.unit,
        note=clean(parameter.note),
        srgb="" if srgb is None else ", ".join(map(measured, srgb.estimate.tolist(), srgb.sd.tolist())),
        swatch="" if srgb is None or srgb.hex is None else srgb.hex,
        channels=tuple(_cells(parameter, c if width == 3 else None) for c in range(width)),
    )


def _numbered(name: str) -> bool:
    """Whether a parameter is that of a joint fit's second photograph or a later one: `pedestal_2`."""
    return name.rpartition("_")[2].isdecimal()


def _cells(parameter: Estimate, channel: int | None) -> Cells:
    value, sd = _at(parameter.estimate, channel), _at(parameter.sd, channel)
    statistical = _at(parameter.sd_statistical, channel)
    radian = parameter.unit == "rad"
    return Cells(
        channel="" if channel is None else CHANNELS[channel],
        estimate=measured(value, sd),
        sd=digits(sd, 2),
        sd_statistical=digits(statistical, 2),
        interval_68=_interval(parameter.interval_68, channel, sd),
        interval_90=_interval(parameter.interval_90, channel, sd),
        to_prior=digits(_at(parameter.posterior_to_prior, channel), 2),
        degrees=f"{degrees(value, sd)}°" if radian and value is not None else "",
    )


def degrees(value: float | None, sd: float | None) -> str:
    """Radians as degrees, with the digits that the sd allows."""
    if value is None:
        return MISSING
    return measured(math.degrees(value), None if sd is None else math.degrees(sd))


def _interval(interval: tuple[Any, Any] | None, channel: int | None, sd: float | None) -> str:
    if interval is None:
        return MISSING
    low, high = (measured(_at(end, channel), sd) for end in interval)
    return f"{low} … {high}"


def _at(value: object, channel: int | None) -> float | None:
    """One channel of a number or a colour as a float; None where it is missing or not finite."""
    if value is None:
        return None
    flat = np.ravel(np.asarray(value, float))
    one = float(flat[channel if channel is not None and len(flat) == 3 else 0])
    return one if math.isfinite(one) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagRow:
    """One flag in words."""

    name: str
    meaning: str
    about: str  # the whole photograph, which fit, or which of its parameters


def flag_rows(report: MaterialReport) -> list[FlagRow]:
    """The flags of the photograph, of the separation by colour and of the best fit, each once."""
    best = report.fits[report.best] if report.fits else None
    found = [(flag, "") for flag in report.flags]
    found += [(flag, "separation by colour") for flag in (report.separation.flags if report.separation else ())]
    found += [(flag, concerned(best, flag) or "best fit") for flag in (best.flags if best else ())]
    names: dict[str, str] = {}
    for flag, about in found:
        names.setdefault(str(flag), about)
    return [FlagRow(name=clean(flag), meaning=meaning(flag), about=about) for flag, about in names.items()]


def concerned(fit: Fit | None, flag: str) -> str:
    """The parameters of a fit that a flag is about; empty where it is about the whole."""
    return ", ".join(clean(parameter.name) for parameter in (fit.parameters if fit else ()) if flag in parameter.flags)


def meaning(flag: str) -> str:
    """What a flag says; its own name where it is in no table."""
    try:
        return MEANING[Flag(flag)]
    except ValueError:
        return clean(flag)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRow:
    """One model beside the best: how much worse it predicts, and how well it fits."""

    index: int
    title: str
    variant: str
    diffuse: str
    shape: str
    difference: str
    sd: str
    chi2: str
    status: str
    flags: tuple[str, ...]
    best: bool
    preferred: bool


def ranking(report: MaterialReport) -> tuple[int, ...]:
    """Indices of the fits by predictive density, the best one first."""
    density = [fit.elpd if math.isfinite(fit.elpd) else -math.inf for fit in report.fits]
    order = sorted(range(len(density)), key=lambda index: (index != report.best, -density[index], index))
    return tuple(order)


def model_rows(report: MaterialReport) -> list[ModelRow]:
    """All fits, the best first."""
    differences = [elpd_difference(report.fits[report.best], fit) for fit in report.fits]
    return [_model(report, index, *differences[index]) for index in ranking(report)]


def elpd_difference(best: Fit, other: Fit) -> tuple[float | None, float | None]:
    """By how much `other` predicts worse (negative) and the sd of that, from the blocks' own differences."""
    if len(best.elpd_blocks) != len(other.elpd_blocks) or not math.isfinite(other.elpd - best.elpd):
        return None, None
    value, sd = difference(other, best)
    return value, sd if math.isfinite(sd) else None


def _model(report: MaterialReport, index: int, ahead: float | None, sd: float | None) -> ModelRow:
    fit = report.fits[index]
    best = index == report.best
    return ModelRow(
        index=index,
        title=title(fit.model),
        variant=", ".join(f"{option} {choice}" for option, choice in fit.variant.items()),
        diffuse=title(fit.diffuse),
        shape=shape_text(fit),
        difference="0" if best else behind(ahead),
        sd="" if best or sd is None else behind(-sd, 2),
        chi2=digits(fit.chi2_reduced, 4),
        status=clean(fit.status),
        flags=tuple(clean(flag) for flag in fit.flags),
        best=best,
        preferred=index == report.preferred,
    )


def behind(difference: float | None, count: int = 3) -> str:
    """A difference of log densities, turned positive; below a hundredth it is nothing."""
    return "0.00" if difference is not None and abs(difference) < 0.005 else digits(difference and -difference, count)


def title(lobe: str) -> str:
    """A lobe's name for people."""
    return LOBES[lobe].title if lobe in LOBES else clean(lobe)


def shape_text(fit: Fit) -> str:
    """The shape numbers in a few words: roughness 6.88°, alpha 0.168."""
    by_name = {parameter.name: parameter for parameter in fit.parameters}
    return ", ".join(_shape_number(name, value, by_name.get(name)) for name, value in sorted(fit.shape.items()))


def _shape_number(name: str, value: float, parameter: Estimate | None) -> str:
    mean, sd = (_at(parameter.estimate, None), _at(parameter.sd, None)) if parameter else (value, None)
    told = value if mean is None else mean
    if name.endswith("_rad"):
        return f"{name.removesuffix('_rad').replace('_', ' ')} {degrees(told, sd)}°"
    return f"{name.replace('_', ' ')} {measured(told, sd)}"


def numbers(values: Sequence[float] | np.ndarray | None, count: int = 4) -> str:
    """A vector as text: (0.45, 0.35, 0.82)."""
    if values is None:
        return MISSING
    return "(" + ", ".join(digits(float(value), count) for value in values) + ")"
