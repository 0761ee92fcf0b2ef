"""A fit's own pictures: what known shape separates, exact where colour alone cannot tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import on_sphere
from toolkit.records import Fit, Floats, ModelLayers
from toolkit.reflectance.cosines import once
from toolkit.reflectance.fresnel import reflectance
from toolkit.reflectance.lobe import LOBES

from .lit import Lit, lit_by
from .model import TYPICAL_F0, mirror_cosine

CHUNK = 1 << 15  # samples predicted at a time, so that what lies between a lobe's passes stays in the cache


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
    """Predict radiance at pixel coordinates (N,) of the sphere; in shadow what comes back from around, or nothing."""
    diffuse, specular, middle = *np.empty((2, 3, len(x_px))), mirror_cosine(fit.scene, fit.scene.lights[0])
    for start in range(0, len(x_px), CHUNK):
        part = slice(start, start + CHUNK)
        matte, shine = _sent(fit, x_px[part], y_px[part], middle)
        _add_up(matte, diffuse[:, part])
        _add_up(shine, specular[:, part])
    return Prediction(diffuse=diffuse.T, specular=specular.T, pedestal=np.asarray(fit.colours["pedestal"]))


class _Sent(NamedTuple):
    """What a lobe sends of one light: a colour, (3, N) or (3, 1), times a brightness (N,)."""

    colour: Floats
    brightness: Floats


def _sent(fit: Fit, x_px: Floats, y_px: Floats, middle: float) -> tuple[list[_Sent], list[_Sent]]:
    """What the two lobes send at pixel coordinates (N,), a light each; `middle` as for `_specular_colour`."""
    body, gloss = LOBES[fit.diffuse], LOBES[fit.model]
    numbers = [fit.shape[p.name] for p in gloss.parameters], [fit.shape[p.name] for p in body.parameters]
    diffuse, specular = [], []
    for lit in lit_by(fit.scene, x_px, y_px, whole=gloss.sees_source):
        matte = body.value(lit.cosines, numbers[1])
        if lit.returned is not None:
            matte = np.maximum(matte + lit.returned, 0.0)  # a first order alone has less than nothing on its far side
        shine = gloss.value(lit.cosines, numbers[0], fit.variant)
        albedo, light = np.asarray(fit.colours["diffuse_albedo"])[:, None], lit.colour[:, None]
        diffuse.append(_Sent(light * albedo, lit.falloff * matte))
        specular.append(_Sent(_specular_colour(fit, lit, light, middle), lit.falloff * shine))
    return diffuse, specular


def _add_up(lights: list[_Sent], layer: Floats) -> None:
    """The sum over the lights, into a layer (3, ...) of as many places."""
    for c, channel in enumerate(layer):
        total, *others = (one.colour[c] * one.brightness for one in lights)
        for other in others:
            total += other
        channel[...] = total.reshape(channel.shape)


def _specular_colour(fit: Fit, lit: Lit, light: Floats, middle: float) -> Floats:
    """The specular lobe's colour under a light's (3, 1), at each sample where Fresnel's factor varies.

    `middle` is the cosine of theta_d in the middle of the highlight, where the strength is told.
    """
    if "specular_albedo" in fit.colours:
        return np.asarray(light * fit.colours["specular_albedo"][:, None])
    f0 = np.nan_to_num(fit.colours["specular_f0"], nan=TYPICAL_F0)[:, None]
    choice, cosine = fit.variant.get("fresnel", "schlick"), lit.cosines.l_dot_h
    there = reflectance(once(cosine), f0, choice)  # a far light's is one for all
    reference = reflectance(np.array(middle), f0, choice)
    return np.asarray(light * fit.colours["specular_strength"][:, None] / np.maximum(reference, 1e-12) * there)


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
    x, y = origin_px[0] + step_px * np.arange(width), origin_px[1] + step_px * np.arange(height)
    seen = on_sphere(fit.scene.camera, fit.scene.sphere, x[None, :], y[:, None])
    diffuse, specular = _pictures(fit, x, y, seen)
    if places_px is not None:
        for layer in (diffuse, specular):
            _move_to(places_px / step_px, layer)
    if fit.scene.camera.blur_px2 > 0.0:
        specular = _blurred(specular, _blur(fit, step_px))
    return ModelLayers(
        photograph=np.asarray(picture, np.float32),
        diffuse=np.moveaxis(diffuse, 0, -1),
        specular=np.moveaxis(specular, 0, -1),
        used=np.moveaxis(np.moveaxis(used, -1, 0) & seen, 0, -1),
        pedestal=np.array(fit.colours["pedestal"]),
        origin_px=origin_px,
        step_px=step_px,
    )


def rows_beyond(fit: Fit, step_px: int) -> int:
    """How many rows of a picture above and below some rows their layers depend on, by the camera's blur and the moves
    to the channels' places.
    """
    return 1 + (round(4.0 * _blur(fit, step_px)) + 1 if fit.scene.camera.blur_px2 > 0.0 else 0)


def _pictures(fit: Fit, x: Floats, y: Floats, seen: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """The two layers (3, h, w), a few lines of the picture at a time; each channel lies together in memory.

    A line's places off the sphere are predicted as the sphere's nearest on it, so that numbers stay in their rows.
    """
    layers = np.full((2, 3, *seen.shape), np.nan, np.float32)
    first, last = seen.argmax(axis=1), seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1)
    middle = mirror_cosine(fit.scene, fit.scene.lights[0])
    for rows in _bands(np.flatnonzero(seen.any(axis=1)), seen.shape[1]):
        columns = slice(int(first[rows].min()), int(last[rows].max()) + 1)
        across = np.clip(x[columns], x[first[rows], None], x[last[rows], None])
        down = np.broadcast_to(y[rows, None], across.shape)
        nothing = np.where(seen[rows, columns], 0.0, np.nan).ravel()
        for layer, lights in zip(layers, _sent(fit, across.ravel(), down.ravel(), middle), strict=True):
            for one in lights:
                np.add(one.brightness, nothing, out=one.brightness)
            _add_up(lights, layer[:, rows, columns])
    return layers[0], layers[1]


def _bands(lines: NDArray[np.intp], width: int) -> Iterator[slice]:
    """Lines of a picture, from the first to the last of `lines`, as many at a time as CHUNK samples are."""
    many = max(CHUNK // width, 1)
    for start in range(int(lines[0]), int(lines[-1]) + 1, many) if len(lines) else ():
        yield slice(start, min(start + many, int(lines[-1]) + 1))


def _blur(fit: Fit, step_px: int) -> float:
    """Sd of the camera's blur, in pixels of the picture."""
    return float(np.sqrt(fit.scene.camera.blur_px2)) / step_px


def _blurred(layer: Floats, sd: float) -> Floats:
    """The layer (3, h, w) through a lens that blurs by `sd` pixels of it; what is off the sphere gives no light."""
    import cv2

    dark = [cv2.GaussianBlur(np.nan_to_num(channel), (0, 0), sd) for channel in layer]
    return np.where(np.isfinite(layer), np.array(dark), layer)


def _move_to(places: Floats, layer: Floats) -> None:
    """Move the layer (3, h, w) a fraction of a pixel aside, channel by channel, by its own slope; the limb stays.

    In its place, some lines at a time: memory touched for the first time costs more than the sums.
    """
    lines = max(CHUNK // layer.shape[2], 2)
    for channel, (dx, dy) in zip(layer, places.astype(np.float32), strict=True):
        if not (dx or dy):
            continue
        before, last = 2 * channel[:1] - channel[1:2], 2 * channel[-1:] - channel[-2:-1]  # goes on as at its edges
        for start in range(0, len(channel), lines):
            to, after = channel[start : start + lines], channel[start + lines : start + lines + 1]
            here = np.concatenate([before, to, after if len(after) else last])
            before = here[-2:-1]
            aside = to + dx * _slope_along(to)
            aside += dy * ((here[2:] - here[:-2]) / 2)
            np.copyto(to, np.clip(aside, 0, np.inf), where=~np.isnan(aside))


def _slope_along(lines: Floats) -> Floats:
    """How much the lines (n, w) rise from sample to sample: numpy's gradient along them, without what it checks."""
    slope = np.empty_like(lines)
    np.subtract(lines[:, 2:], lines[:, :-2], out=slope[:, 1:-1])
    slope[:, 1:-1] /= 2
    slope[:, [0, -1]] = lines[:, [1, -1]] - lines[:, [0, -2]]
    return slope
