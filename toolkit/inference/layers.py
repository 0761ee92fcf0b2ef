"""A fit's own pictures: what known shape separates, exact where colour alone cannot tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from toolkit.geometry.sphere import Surface, on_sphere, surface
from toolkit.records import Fit, Floats, ModelLayers
from toolkit.reflectance.cosines import once
from toolkit.reflectance.fresnel import reflectance
from toolkit.reflectance.lobe import LOBES

from .aside import draw_aside, limb_of
from .lit import Lit, lit_on
from .model import TYPICAL_F0, mirror_cosine

CHUNK = 1 << 16  # samples predicted at a time, so that what lies between a lobe's passes stays in the cache


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
        seen = surface(fit.scene.camera, fit.scene.sphere, x_px[part], y_px[part])
        for layer, lights in zip((diffuse, specular), _sent(fit, seen, middle), strict=True):
            _add_up(lights, layer[:, part])
    return Prediction(diffuse=diffuse.T, specular=specular.T, pedestal=np.asarray(fit.colours["pedestal"]))


class _Sent(NamedTuple):
    """What a lobe sends of one light: a colour, (3, ...) that broadcasts, times a brightness (...)."""

    colour: Floats
    brightness: Floats


def _sent(
    fit: Fit, seen: Surface, middle: float, shown: NDArray[np.bool_] | None = None
) -> tuple[list[_Sent], list[_Sent]]:
    """What the two lobes send, a light each, in the surface's precision; NaN but where it is `shown`.

    `middle` as for `_specular_colour`.
    """
    body, gloss, number = LOBES[fit.diffuse], LOBES[fit.model], seen.normal.dtype.type
    numbers = [[number(fit.shape[p.name]) for p in lobe.parameters] for lobe in (body, gloss)]
    albedo = np.asarray(fit.colours["diffuse_albedo"])
    diffuse, specular = [], []
    for lit in lit_on(fit.scene, seen, whole=gloss.sees_source):
        matte, shine = body.value(lit.cosines, numbers[0]), gloss.value(lit.cosines, numbers[1], fit.variant)
        if lit.returned is not None:
            matte = np.maximum(matte + lit.returned, 0.0)  # a first order alone has less than nothing on its far side
        falloff = lit.falloff if shown is None else np.where(shown, lit.falloff, number(np.nan))
        diffuse.append(_Sent(_each(lit.colour * albedo, matte), falloff * matte))
        specular.append(_Sent(_specular_colour(fit, lit, middle), falloff * shine))
    return diffuse, specular


def _each(colour: Floats, places: Floats) -> Floats:
    """A colour (3,) that broadcasts over channels of places (...), of their kind of number."""
    return np.asarray(colour, places.dtype).reshape(3, *(1,) * places.ndim)


def _add_up(lights: list[_Sent], layer: Floats) -> None:
    """The sum over the lights, into a layer (3, ...) of as many places."""
    first, *others = lights
    for c, channel in enumerate(layer):
        np.multiply(first.colour[c], first.brightness, out=channel)
        for other in others:
            channel += other.colour[c] * other.brightness


def _specular_colour(fit: Fit, lit: Lit, middle: float) -> Floats:
    """The specular lobe's colour under a light, at each sample where Fresnel's factor varies.

    `middle` is the cosine of theta_d in the middle of the highlight, where the strength is told.
    """
    cosine = lit.cosines.l_dot_h
    if "specular_albedo" in fit.colours:
        return _each(lit.colour * fit.colours["specular_albedo"], cosine)
    f0, choice = np.nan_to_num(fit.colours["specular_f0"], nan=TYPICAL_F0), fit.variant.get("fresnel", "schlick")
    strength = lit.colour * fit.colours["specular_strength"]
    scale = strength / np.maximum(reflectance(np.array(middle), f0, choice), 1e-12)
    there = reflectance(once(cosine), _each(f0, cosine), choice)  # a far light's is one for all
    return np.asarray(_each(scale, cosine) * there)


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
    x, y = (o + step_px * np.arange(-1.0, n + 1) for o, n in zip(origin_px, (width, height), strict=True))
    seen = on_sphere(fit.scene.camera, fit.scene.sphere, x[None, :], y[:, None])
    places = np.zeros((3, 2)) if places_px is None else places_px / step_px
    diffuse, specular = _pictures(fit, x, y, seen, places)
    if fit.scene.camera.blur_px2 > 0.0:
        specular = _blurred(specular, _blur(fit, step_px))
    return ModelLayers(
        photograph=np.asarray(picture, np.float32),
        diffuse=np.moveaxis(diffuse, 0, -1),
        specular=np.moveaxis(specular, 0, -1),
        used=np.moveaxis(np.moveaxis(used, -1, 0) & seen[1:-1, 1:-1], 0, -1),
        pedestal=np.array(fit.colours["pedestal"]),
        origin_px=origin_px,
        step_px=step_px,
    )


def rows_beyond(fit: Fit, step_px: int) -> int:
    """How many rows of a picture above and below some rows their layers depend on, by the camera's blur."""
    return round(4.0 * _blur(fit, step_px)) + 1 if fit.scene.camera.blur_px2 > 0.0 else 0


def _pictures(
    fit: Fit, x: Floats, y: Floats, seen: NDArray[np.bool_], places: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The two layers (3, h, w), a few lines of the picture at a time; each channel lies together in memory.

    `x`, `y` and `seen` have a line and a column more on every side, for the slopes by which a layer moves. A line's
    places off the sphere are predicted as the sphere's nearest on it, so that numbers stay in their rows.
    """
    height, width = seen.shape
    layers = tuple(np.full((3, height - 2, width - 2), np.nan, np.float32) for _ in range(2))
    first, last = seen.argmax(axis=1), width - 1 - seen[:, ::-1].argmax(axis=1)
    middle = mirror_cosine(fit.scene, fit.scene.lights[0])
    for rows in _bands(np.flatnonzero(seen[1:-1].any(axis=1)), width):
        lines = slice(rows.start, rows.stop + 2)
        ball = np.flatnonzero(seen[lines].any(axis=0))
        columns = slice(max(ball[0] - 1, 0), min(ball[-1] + 2, width))
        shown = np.ascontiguousarray(seen[lines, columns])
        limb = limb_of(shown)
        across = np.clip(x[columns], x[first[lines], None], x[last[lines], None])
        there = surface(fit.scene.camera, fit.scene.sphere, across, y[lines, None], dtype=_precision(fit))
        drawn = np.empty((3, *shown.shape), np.float32)
        for layer, lights in zip(layers, _sent(fit, there, middle, shown), strict=True):
            _add_up(lights, drawn)
            draw_aside(places, drawn, limb, layer[:, rows, columns.start : columns.stop - 2])
    return layers[0], layers[1]


def _precision(fit: Fit) -> type[np.floating[Any]]:
    """In which a picture is worked out: a cosine near 1 of single precision would tell no angle."""
    return np.float64 if LOBES[fit.model].sharp_angle == "mirror" else np.float32


def _bands(lines: NDArray[np.intp], width: int) -> Iterator[slice]:
    """Lines of a picture, from the first to the last of `lines`: as many at a time, with two more, as CHUNK holds."""
    if len(lines):
        start, stop = int(lines[0]), int(lines[-1]) + 1
        count = -(-(stop - start) // max(CHUNK // width - 2, 1))
        edges = [start + (stop - start) * i // count for i in range(count + 1)]  # none of them with hardly any
        yield from map(slice, edges, edges[1:])


def _blur(fit: Fit, step_px: int) -> float:
    """Sd of the camera's blur, in pixels of the picture."""
    return float(np.sqrt(fit.scene.camera.blur_px2)) / step_px


def _blurred(layer: Floats, sd: float) -> Floats:
    """The layer (3, h, w) through a lens that blurs by `sd` pixels of it; what is off the sphere gives no light."""
    import cv2

    dark = [cv2.GaussianBlur(np.nan_to_num(channel), (0, 0), sd) for channel in layer]
    return np.where(np.isfinite(layer), np.array(dark), layer)
