"""Separation by colour alone, after Klinker, Shafer & Kanade (1990), "A physical approach to color image
understanding", IJCV 4.

One object of one hue under one light: its colours lie in a plane, in a skewed T. The plane and the matte line give
the body colour, the light's colour is given or estimated, every pixel is projected on the two with its noise. What
the angle between the two colours allows is all that colour can tell; where it is too small, a flag says so.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import ColourLayers, Floats, Noise

from .body import Body, body_colour
from .cluster import classify
from .coefficients import apart
from .fill import fill
from .highlight import highlight_line
from .illuminant import of_samples, unit_colour
from .projection import Layers, project, unknown
from .samples import Blocks, Mask, Samples, block_size, blocks, samples
from .verdict import verdict

LOUDER = 3.0  # noise found over noise told, above which the matte line is fitted anew


def separate(
    picture: Floats,
    *,
    variance: Floats | Noise,
    usable: Mask | None = None,
    bloom: Mask | None = None,
    on_sphere: Mask | None = None,
    light_colour: Floats | None = None,
    light_covariance: Floats | None = None,
    light_source: str = "given",
    light_reason: str = "",
    origin_px: tuple[float, float] = (0.0, 0.0),
    step_px: int = 1,
) -> ColourLayers:
    """Diffuse and specular layers (h, w, 3) of a linear `picture` (h, w, 3) of one object of one hue.

    `variance` of its samples: (h, w, 3), (3,), or a Noise; `usable` (h, w, 3) False where a channel is clipped;
    `bloom` (h, w) True beside clipped pixels; `on_sphere` (h, w). `light_colour` (3,) of any length, its covariance
    (3, 3) at unit length; without it, it is estimated from the highlight (`best_illuminant` knows more ways).
    Pixels with clipped channels are separated by the others and by the body's shading around;
    where none is left, the specular layer holds the least it can be and its variance is infinite.
    Raises BadInputError for wrong shapes, no light, or too few pixels with all channels usable.
    """
    ready = samples(picture, variance=variance, usable=usable, bloom=bloom, on_sphere=on_sphere)
    if light_colour is None:
        source = of_samples(ready)
        light, of_light, light_source, light_reason = source.colour, source.covariance, source.source, source.reason
    else:
        light = unit_colour(light_colour)
        of_light = np.zeros((3, 3)) if light_covariance is None else np.asarray(light_covariance, float)
    cloud, body = _cloud_and_body(ready, light)
    cluster = classify(cloud)
    line = highlight_line(cloud, body.colour, light) if body.seen else None
    found = _layers(ready, body, light, of_light)
    angle, angle_sd = angle_between(body.colour, body.covariance, light, of_light)
    flags = verdict(ready, cloud, cluster, body, line, found, (angle, angle_sd))
    found = found.times(ready.unit)
    return ColourLayers(
        method="dichromatic",
        body_colour=body.colour,
        light_colour=light,
        body_covariance=body.covariance,
        light_covariance=of_light,
        light_source=light_source,
        angle_deg=angle,
        angle_sd_deg=angle_sd,
        cluster=cluster.kind,
        along_body=found.along_body,
        along_light=found.along_light,
        covariance=found.covariance,
        residual=found.residual,
        corner=line.corner * ready.unit if line else np.full(3, np.nan),
        highlight_colour=line.direction if line else np.full(3, np.nan),
        origin_px=origin_px,
        step_px=step_px,
        flags=flags,
        light_reason=light_reason,
    )


def _cloud_and_body(ready: Samples, light: Floats) -> tuple[Blocks, Body]:
    """The block means and the body colour, on larger blocks where the noise is well above what was told."""
    size = block_size(ready)
    cloud = blocks(ready, size)
    body = body_colour(cloud, light)
    if body.misfit < LOUDER or (larger := block_size(ready, body.misfit)) <= size:
        return cloud, body
    cloud = blocks(ready, larger)
    return cloud, body_colour(cloud, light)


def _layers(ready: Samples, body: Body, light: Floats, of_light: Floats) -> Layers:
    """All pixels on the two colours; nothing but NaN where the body's colour is not seen beside the light's."""
    if not (body.seen and apart(body.colour, light)):
        return unknown(ready)
    found = project(ready, body.colour, light, body_covariance=body.covariance, light_covariance=of_light)
    return fill(ready, found, body.colour, light)


def angle_between(first: Floats, of_first: Floats, second: Floats, of_second: Floats) -> tuple[float, float]:
    """Angle of two unit colours (3,) with covariances (3, 3), and its sd, degrees."""
    cross, dot = float(np.linalg.norm(np.cross(first, second))), float(first @ second)
    angle = float(np.arctan2(cross, dot))
    if cross < 1e-12:
        return 0.0, float(np.degrees(np.sqrt(np.trace(of_first) + np.trace(of_second))))
    along = (second - dot * first) / cross, (first - dot * second) / cross
    variance = float(along[0] @ of_first @ along[0] + along[1] @ of_second @ along[1])
    return float(np.degrees(angle)), float(np.degrees(np.sqrt(max(variance, 0.0))))
