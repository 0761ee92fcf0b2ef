"""A fit's own pictures: what known shape separates, exact where colour alone cannot tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import on_sphere
from toolkit.records import Fit, Floats, ModelLayers
from toolkit.reflectance.fresnel import reflectance
from toolkit.reflectance.lobe import LOBES

from .model import TYPICAL_F0, Lit, lit_by, mirror_cosine

CHUNK = 1 << 18  # samples predicted at a time, so that memory stays flat


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """Radiance of a fit at pixel coordinates: (N, 3) each, the pedestal (3,)."""

    diffuse: Floats
    specular: Floats
    pedestal: Floats

    @property
    def model(self) -> Floats:
        """The whole radiance (N, 3)."""
        return self.diffuse + self.specular + self.pedestal


def predict(fit: Fit, x_px: Floats, y_px: Floats) -> Prediction:
    """Predict radiance at pixel coordinates (N,) of the sphere; zero in shadow."""
    parts = [_predict(fit, x_px[i : i + CHUNK], y_px[i : i + CHUNK]) for i in range(0, max(len(x_px), 1), CHUNK)]
    return Prediction(
        diffuse=np.concatenate([d for d, _ in parts]),
        specular=np.concatenate([s for _, s in parts]),
        pedestal=np.asarray(fit.colours["pedestal"]),
    )


def _predict(fit: Fit, x_px: Floats, y_px: Floats) -> tuple[Floats, Floats]:
    body, gloss = LOBES[fit.diffuse], LOBES[fit.model]
    numbers = [fit.shape[p.name] for p in gloss.parameters], [fit.shape[p.name] for p in body.parameters]
    diffuse, specular = np.zeros((len(x_px), 3)), np.zeros((len(x_px), 3))
    for lit in lit_by(fit.scene, x_px, y_px, whole=gloss.sees_source):
        irradiance = lit.falloff[:, None] * lit.colour
        diffuse += irradiance * body.value(lit.cosines, numbers[1])[:, None] * fit.colours["diffuse_albedo"]
        value = gloss.value(lit.cosines, numbers[0], fit.variant)[:, None]
        specular += irradiance * value * specular_colour(fit, lit)
    return diffuse, specular


def specular_colour(fit: Fit, lit: Lit) -> Floats:
    """The specular lobe's colour at each sample (N, 3): Fresnel's factor where the lobe has one."""
    if "specular_albedo" in fit.colours:
        return np.asarray(fit.colours["specular_albedo"])
    f0 = np.nan_to_num(fit.colours["specular_f0"], nan=TYPICAL_F0)
    choice = fit.variant.get("fresnel", "schlick")
    reference = reflectance(np.array(mirror_cosine(fit.scene, fit.scene.lights[0])), f0, choice)
    there = reflectance(lit.cosines.l_dot_h[:, None], f0, choice)
    return np.asarray(fit.colours["specular_strength"] * there / np.maximum(reference, 1e-12))


def layers_of(
    fit: Fit,
    picture: Floats,
    used: NDArray[np.bool_],
    *,
    origin_px: tuple[float, float],
    step_px: int,
    places_px: Floats | None = None,
) -> ModelLayers:
    """The fit's layers over a picture (h, w, 3) placed as in `Plane`; NaN off the sphere.

    `places_px` (3, 2) is where each channel's samples lie about a pixel's own place: a mosaic's in its quad.
    """
    height, width = picture.shape[:2]
    row, column = np.ogrid[:height, :width]
    x, y = origin_px[0] + step_px * column, origin_px[1] + step_px * row
    seen = on_sphere(fit.scene.camera, fit.scene.sphere, x, y)
    row, column = np.nonzero(seen)
    there = predict(fit, origin_px[0] + step_px * column, origin_px[1] + step_px * row)

    def image(values: Floats) -> Floats:
        layer = np.full((height, width, 3), np.nan, np.float32)
        layer[seen] = values
        return layer if places_px is None else _at_places(layer, places_px / step_px)

    photograph = np.asarray(picture, np.float32)
    diffuse, specular = image(there.diffuse), image(there.specular)
    if fit.scene.camera.blur_px2 > 0.0:
        specular = _blurred(specular, float(np.sqrt(fit.scene.camera.blur_px2)) / step_px)
    model = diffuse + specular + np.asarray(there.pedestal, np.float32)
    return ModelLayers(
        photograph=photograph,
        diffuse=diffuse,
        specular=specular,
        model=model,
        residual=photograph - model,
        used=used & seen[..., None],
        pedestal=np.array(there.pedestal),
        origin_px=origin_px,
        step_px=step_px,
    )


def _blurred(layer: Floats, sd: float) -> Floats:
    """The layer (h, w, 3) through a lens that blurs by `sd` pixels of it; what is off the sphere gives no light."""
    import cv2

    dark = np.nan_to_num(layer)
    return np.where(np.isfinite(layer), cv2.GaussianBlur(dark, (0, 0), sd), layer)


def _at_places(layer: Floats, places: Floats) -> Floats:
    """The layer (h, w, 3) a fraction of a pixel aside, channel by channel, by its own slope; the limb stays."""
    moved = layer.copy()
    for channel, (dx, dy) in enumerate(places):
        if dx or dy:
            down, right = np.gradient(layer[..., channel])
            aside = layer[..., channel] + np.float32(dx) * right + np.float32(dy) * down
            moved[..., channel] = np.where(np.isnan(aside), layer[..., channel], np.maximum(aside, 0))
    return moved
