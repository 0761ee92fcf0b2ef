"""Layers of a real glossy ball under many lights: do they speak of one material?

The diffuse layers of a joint fit, as maps of albedo, against their mean over the lights; each photograph's specular
energy against what the others' lobe predicts in its light. Needs the photographs (`FIT_MATERIAL_DATA`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pipelines.fit_material import fit_jointly, fit_material
from pipelines.settings import Settings
from tests.realdata import folder
from tests.validation.test_photographs import photograph, settings_of
from toolkit.geometry.sphere import surface
from toolkit.inference.joint import of_photograph
from toolkit.inference.layers import predict
from toolkit.records import Fit, Floats, ModelLayers, Scene

EVERY = 6  # of the 48 lights: eight
OFF_HIGHLIGHT_RAD = np.radians(15.0)
LEAST_N_DOT_L, LEAST_N_DOT_V = 0.1, 0.25
GRID = 180  # side of the common map, pixels: more than the ball's box


def settings_under(index: int) -> Settings:
    """One photograph's scene with its calibrated irradiance; GGX over Wolff's body."""
    place = folder("diligent_ball")
    light = {
        "kind": "directional",
        "direction": np.loadtxt(place / "light_directions.txt")[index].tolist(),
        "direction_sd_deg": 1.0,
        "irradiance": np.loadtxt(place / "light_intensities.txt")[index].tolist(),
    }
    return settings_of(index, light=[light], fit={"models": ["ggx"], "diffuse": ["wolff"], "ess": 500})


def albedo_scatter(indices: Sequence[int]) -> float:
    """Rms over lights and places of the albedo maps' difference from their mean, weighted as the body is lit."""
    report = fit_jointly([(photograph(i), settings_under(i)) for i in indices])
    best = report.fits[report.best]
    albedo, lit = [], []
    for v, one in enumerate(report.photographs):
        assert one.layers is not None
        fit = of_photograph(best, v)
        there = _off_highlight(one.layers, fit.scene)
        body = one.layers.photograph - one.layers.pedestal - one.layers.specular
        shading = np.maximum(one.layers.diffuse / np.asarray(fit.colours["diffuse_albedo"]), 1e-12)
        albedo.append(_placed(np.where(there, body / shading, np.nan), one.layers, fit.scene))
        irradiance = np.asarray(fit.scene.lights[0].irradiance)
        lit.append(_placed(np.where(there, shading / irradiance, 0.0), one.layers, fit.scene))
    maps, weight = np.array(albedo), np.nan_to_num(np.array(lit)) ** 2
    weight[~np.isfinite(maps)] = 0.0
    maps[~np.isfinite(maps)] = 0.0
    several = (weight > 0).sum(axis=0) > 1
    mean = (weight * maps).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-300)
    square = weight * (maps / np.maximum(mean, 1e-300) - 1.0) ** 2
    return float(np.sqrt(square[:, several].sum() / weight[:, several].sum()))


def energy_errors(indices: Sequence[int]) -> Floats:
    """For each photograph (N,), the specular energy that the others' median lobe predicts over its own, less 1."""
    reports = [fit_material(photograph(i), settings_under(i)) for i in indices]
    fits = [report.fits[report.best] for report in reports]
    errors = []
    for k, (report, own) in enumerate(zip(reports, fits, strict=True)):
        others = fits[:k] + fits[k + 1 :]
        alike: dict[str, Any] = {
            part: {name: np.median([getattr(f, part)[name] for f in others], axis=0) for name in getattr(own, part)}
            for part in ("shape", "colours")
        }
        assert report.layers is not None
        errors.append(_energy(replace(own, **alike), report.layers) / _energy(own, report.layers) - 1.0)
    return np.array(errors)


def _energy(fit: Fit, layers: ModelLayers) -> float:
    """Light in the specular lobe over the ball's pixels, relative to the irradiance."""
    x, y = _pixels(layers)
    on = np.isfinite(layers.model[..., 0]).ravel()
    irradiance = np.asarray(fit.scene.lights[0].irradiance)
    return float(np.sum(predict(fit, x[on], y[on]).specular / irradiance))


def _pixels(layers: ModelLayers) -> tuple[Floats, Floats]:
    row, column = np.mgrid[: layers.model.shape[0], : layers.model.shape[1]].reshape(2, -1)
    return layers.origin_px[0] + layers.step_px * column, layers.origin_px[1] + layers.step_px * row


def _off_highlight(layers: ModelLayers, scene: Scene) -> Floats:
    """Usable places (h, w, 1) that are lit, in view and well away from the highlight."""
    seen = surface(scene.camera, scene.sphere, *_pixels(layers))
    light = scene.lights[0].at(seen.normal)[0]
    half = light + seen.view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    dot = [np.einsum("ni,ni->n", seen.normal, other) for other in (light, seen.view, half)]
    there = seen.on_sphere & (dot[0] > LEAST_N_DOT_L) & (dot[1] > LEAST_N_DOT_V)
    there &= dot[2] < np.cos(OFF_HIGHLIGHT_RAD)
    return np.asarray(there.reshape(layers.model.shape[:2])[..., None] & layers.used.all(axis=-1, keepdims=True))


def _placed(layer: Floats, layers: ModelLayers, scene: Scene) -> Floats:
    """A layer in the middle of a map that all photographs share, to the nearest pixel."""
    place = np.full((GRID, GRID, 3), np.nan)
    x = round(layers.origin_px[0] - scene.sphere.centre_px[0]) + GRID // 2
    y = round(layers.origin_px[1] - scene.sphere.centre_px[1]) + GRID // 2
    place[y : y + layer.shape[0], x : x + layer.shape[1]] = layer
    return place


def rows() -> list[dict[str, Any]]:
    """What is asked of the ball's layers and what was found."""
    indices = range(0, 48, EVERY)
    scatter, errors = albedo_scatter(indices), np.abs(energy_errors(indices))
    asked = [
        ("ball, 8 lights: albedo maps of the diffuse layers, weighted rms about their mean", scatter, 0.02),
        ("ball, 8 lights: specular energy predicted by the other seven, worst error", float(errors.max()), 0.15),
    ]
    return [
        {"what": what, "found": found, "asked": f"<= {most:g}", "met": found <= most} for what, found, most in asked
    ]
