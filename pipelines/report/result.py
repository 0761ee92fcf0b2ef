"""The result object of STEM.json and of `--json`: one schema, finite numbers, the same bytes for the same run."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pipelines.srgb import light_of, srgb_of
from toolkit.records import (
    Agreement,
    ColourLayers,
    Estimate,
    Fit,
    Light,
    LinearImage,
    MaterialReport,
    Photograph,
    Reference,
    Scene,
)

from .fitted import fitted_light
from .text import base_name, clean

if TYPE_CHECKING:
    from pipelines.settings import Settings
    from toolkit.geometry.lights import AnyLight

DIGITS = 10  # significant ones: far more than any posterior fixes, and the same on every machine's last bits
SOFTWARE = ("numpy", "scipy", "emcee", "rawpy", "opencv-contrib-python-headless", "scikit-image", "colour-science")
_NUMBERS = re.compile(r"\[\n[-+.\w\s,]*(\[\n[-+.\w\s,]*\][\s,]*)*\]")  # lists of numbers; no string holds a raw newline


def result_object(
    report: MaterialReport, settings: Settings | None = None, others: Sequence[Settings] = ()
) -> dict[str, Any]:
    """The result as plain dicts, lists, strings and finite numbers; None where something is not available.

    Colours are lists with one number a channel (red, green, blue of the camera); positions are in pixels.
    `sphere` and each light's own fields say what the fits started from; a light's `fitted` is the best fit's,
    the sphere's `given` what the user's settings say of it. A joint fit has `photographs` as well: of each, the first
    among them, what is its own; `others` are the settings of those after the first.
    """
    best = report.fits[report.best] if report.fits else None
    made = {
        **_frame(base_name(report.image.name)),
        "status": "failed" if (error := _error(best)) else "ok",
        "error": error,
        "flags": [clean(flag) for flag in report.flags],
        **_own(report, settings, best),
        "fits": [_fit(report, fit) for fit in report.fits],
        "best": report.best if best else None,
        "preferred": report.preferred,
        "elpd_difference": _difference(report.elpd_difference),
    }
    if report.photographs:
        made["scale"] = report.scale
        told = [settings, *others, *[None] * len(report.photographs)]
        made["photographs"] = [
            {"flags": [clean(flag) for flag in one.flags], **_own(one, own, part)}
            for one, own, part in zip(report.photographs, told, _parts(report), strict=False)
        ]
    return {key: finite(value) for key, value in made.items()}


def _parts(report: MaterialReport) -> list[Fit]:
    """The best fit as each photograph's."""
    from toolkit.inference.joint import of_photograph  # here, since it brings scipy

    return [of_photograph(report.fits[report.best], v) for v in range(len(report.photographs))]


def _own(one: Photograph | MaterialReport, settings: Settings | None, best: Fit | None) -> dict[str, Any]:
    """What is one photograph's own."""
    shown = ("gain", "read", "source", "gain_sd", "read_sd")
    return {
        "image": _image(one.image),
        "camera": _camera(one.scene),
        "noise": {name: getattr(one.image.noise, name) for name in shown},
        "scale": one.scene.scale,
        "reference": _reference(one.reference) if one.reference else None,
        "colour": _colour(one) if one.colour else None,
        "sphere": _sphere(one.scene, settings),
        "lights": _lights(one.scene, best),
        "separation": _separation(one.separation, one.agreement) if one.separation else None,
    }


def _error(best: Fit | None) -> str | None:
    """Why a result with all its numbers is none to rely on."""
    if best is None:
        return "no model was fitted"
    return None if best.status == "converged" else clean(f"the best fit, {best.model}, failed: {best.status}")


def failure_object(name: str, error: BaseException | str) -> dict[str, Any]:
    """The same object for an image that gave no result: all keys, and `error` in one line."""
    return {**_frame(base_name(name)), "status": "failed", "error": clean(error) or type(error).__name__}


def result_text(result: Mapping[str, Any], *, indent: int | None = 1) -> str:
    """The object as JSON, keys in their documented order, a newline at the end; `indent` None: all on one line."""
    text = json.dumps(result, indent=indent, ensure_ascii=False, allow_nan=False)
    return _NUMBERS.sub(lambda row: " ".join(row[0].split()).replace("[ ", "[").replace(" ]", "]"), text) + "\n"


def software() -> dict[str, str | None]:
    """Versions of what the numbers come from."""
    import platform

    import toolkit

    return {
        "fit-material": toolkit.__version__,
        "python": platform.python_version(),
        **{name: _version(name) for name in SOFTWARE},
    }


@cache  # every result of a batch asks, and a package's description is slow to read
def _version(package: str) -> str | None:
    import importlib.metadata

    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def finite(value: object) -> object:
    """Plain JSON values: arrays become lists, numbers are rounded to ten digits, NaN and infinity become None."""
    if isinstance(value, float | np.floating):  # most are
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return finite(value.tolist())
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    return value if value is None else str(value)


def _frame(name: str) -> dict[str, Any]:
    return {
        "schema": MaterialReport.schema,
        "status": "",
        "error": None,
        "flags": [],
        "image": {**dict.fromkeys(("name", "sha256", "width_px", "height_px", "camera", "colour_space")), "name": name},
        **dict.fromkeys(("camera", "noise", "scale", "reference", "colour", "sphere")),
        "lights": [],
        "separation": None,
        "fits": [],
        **dict.fromkeys(("best", "preferred", "elpd_difference")),
        "software": software(),
    }


def _image(image: LinearImage) -> dict[str, Any]:
    return {
        "name": base_name(image.name),
        "sha256": image.sha256,
        "width_px": image.width_px,
        "height_px": image.height_px,
        "camera": clean(f"{image.metadata.make} {image.metadata.model}".strip()),
        "colour_space": "camera",
    }


def _camera(scene: Scene) -> dict[str, Any]:
    camera = scene.camera
    return {
        "projection": camera.projection,
        "focal_length_px": camera.focal_length_px,
        "principal_point_px": camera.principal_point_px,
    }


def _sphere(scene: Scene, settings: Settings | None) -> dict[str, Any]:
    sphere = scene.sphere
    told = settings.sphere.model_dump() if settings and settings.sphere else None
    return {
        "centre_px": sphere.centre_px,
        "radius_px": sphere.radius_px,
        "source": sphere.source,
        "given": sphere.given or told,
        "sd": np.sqrt(np.diag(sphere.covariance_px2)),
    }


def _lights(scene: Scene, best: Fit | None) -> list[dict[str, Any]]:
    return [
        {**_fields(light), "source": scene.light_source, "fitted": _fitted(best, index) if best else None}
        for index, light in enumerate(scene.lights)
    ]


def _fields(light: Light) -> dict[str, Any]:
    """The light's own registered fields, its direction always among them."""
    own = cast("AnyLight", light).model_dump()
    return {"kind": own.pop("kind"), "direction": cast("AnyLight", light).direction, **own}


def _fitted(best: Fit, index: int) -> dict[str, Any]:
    light = fitted_light(best, index)
    place = {} if light.position is None else {"position": light.position}
    came = {"irradiance": light.irradiance, "returned": light.returned}
    return {"direction": light.direction, **place, "sd_deg": light.sd_deg, **came}


def _separation(layers: ColourLayers, agreed: Agreement | None) -> dict[str, Any]:
    return {
        "method": layers.method,
        "body_colour": layers.body_colour,
        "light_colour": layers.light_colour,
        "light_source": layers.light_source,
        "light_reason": clean(layers.light_reason),
        "light_sd_deg": float(np.degrees(np.sqrt(np.trace(layers.light_covariance)))),
        "angle_deg": layers.angle_deg,
        "angle_sd_deg": layers.angle_sd_deg,
        "flags": [clean(flag) for flag in layers.flags],
        "preferred": agreed.preferred if agreed else None,
        "reason": agreed.reason if agreed else None,
        "difference": agreed.difference if agreed else None,
    }


def _reference(reference: Reference) -> dict[str, Any]:
    return {
        "grey": reference.grey,
        "box_px": reference.box_px,
        "file": None if reference.file is None else base_name(reference.file),
        "sha256": reference.sha256,
        "normal": reference.normal,
        "radiance": reference.radiance,
        "irradiance": reference.irradiance,
        "irradiance_sd": reference.irradiance_sd,
    }


def _colour(one: Photograph | MaterialReport) -> dict[str, Any]:
    shown = ("source", "chart_sha256", "to_srgb", "delta_e")
    return {**{name: getattr(one.colour, name) for name in shown}, "light": light_of(one)}


def _fit(report: MaterialReport, fit: Fit) -> dict[str, Any]:
    return {
        "model": fit.model,
        "variant": fit.variant,
        "diffuse": fit.diffuse,
        "status": clean(fit.status),
        "flags": [clean(flag) for flag in fit.flags],
        "chi2_reduced": fit.chi2_reduced,
        "elpd": fit.elpd,
        "bic": fit.bic,
        "tempering": fit.tempering,
        "parameters": {parameter.name: _parameter(report, fit, parameter) for parameter in fit.parameters},
        "calibration": {name: {"shift": shift, "sd": sd} for name, (shift, sd) in fit.nuisances.items()},
        "posterior": _posterior(fit),
    }


def _parameter(report: MaterialReport, fit: Fit, parameter: Estimate) -> dict[str, Any]:
    shown = ("estimate", "mode", "sd", "sd_statistical", "interval_68", "interval_90", "unit", "posterior_to_prior")
    srgb = srgb_of(report, fit, parameter)
    seen = None if srgb is None else {name: getattr(srgb, name) for name in ("estimate", "sd", "xyz", "hex")}
    flags = [clean(flag) for flag in parameter.flags]
    return {**{name: getattr(parameter, name) for name in shown}, "flags": flags, "srgb": seen}


def _posterior(fit: Fit) -> dict[str, Any]:
    shown = ("samples", "ess_min", "r_hat_max", "tau_max", "acceptance", "seed", "quadrature_error")
    return {name: getattr(fit.diagnostics, name, None) for name in shown}


def _difference(difference: tuple[float, float] | None) -> dict[str, Any]:
    value, sd = difference or (None, None)
    return {"value": value, "sd": sd}
