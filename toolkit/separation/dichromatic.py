"""Separation by colour alone, after Klinker, Shafer & Kanade (1990), "A physical approach to color image
understanding", IJCV 4.

One object of one hue under one light: its colours lie in a plane, in a skewed T. The plane and the matte line give
the body colour, the light's colour is given or estimated, every pixel is projected on the two with its noise. What
the angle between the two colours allows is all that colour can tell; where it is too small, a flag says so.
"""

from __future__ import annotations

import numpy as np

from toolkit.flags import Flag
from toolkit.records import ColourLayers, Floats, Noise

from .body import Body, body_colour
from .cluster import Cluster, classify
from .fill import fill
from .highlight import HighlightLine, highlight_line
from .illuminant import of_samples, unit_colour
from .projection import Layers, project, unknown
from .samples import Blocks, Mask, Samples, block_size, blocks, samples

SMALLEST_ANGLE_DEG = 3.0  # below it, 1 % noise leaves 60 % error in the specular layer
WORST_SPECULAR = 0.5  # relative rms error of the specular layer that noise alone would leave
WORST_MISFIT = 3.0  # of the blocks' distance from the plane, over the noise, where it also is ...
WORST_OFF_PLANE = 0.02  # ... this part of the brightness: a second hue, or a picture that is not linear
CLIPPED_SHARE = 0.01


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
        light, of_light, light_source = source.colour, source.covariance, source.source
    else:
        light = unit_colour(light_colour)
        of_light = np.zeros((3, 3)) if light_covariance is None else np.asarray(light_covariance, float)
    cloud = blocks(ready, block_size(ready))
    cluster = classify(cloud)
    body = body_colour(cloud, light)
    line = highlight_line(cloud, body.colour, light) if body.seen else None
    found = _layers(ready, body, light, of_light)
    clipped = 1 - np.count_nonzero(ready.weight) / np.count_nonzero(ready.on_sphere)
    angle, angle_sd = angle_between(body.colour, body.covariance, light, of_light)
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
        diffuse=found.diffuse,
        specular=found.specular,
        covariance=found.covariance,
        residual=found.residual,
        corner=line.corner if line else np.full(3, np.nan),
        highlight_colour=line.direction if line else np.full(3, np.nan),
        origin_px=origin_px,
        step_px=step_px,
        flags=_flags(cloud, cluster, body, line, _specular_error(found, light), (angle, angle_sd), clipped),
    )


def _layers(ready: Samples, body: Body, light: Floats, of_light: Floats) -> Layers:
    """All pixels on the two colours; nothing but NaN where the body's colour is not seen beside the light's."""
    if not body.seen:
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
    variance = along[0] @ of_first @ along[0] + along[1] @ of_second @ along[1]
    return float(np.degrees(angle)), float(np.degrees(np.sqrt(variance)))


def _flags(
    cloud: Blocks,
    cluster: Cluster,
    body: Body,
    line: HighlightLine | None,
    specular_error: float,
    angle: tuple[float, float],
    clipped: float,
) -> tuple[str, ...]:
    flags = []
    noisy = line is not None and specular_error > WORST_SPECULAR
    if not body.seen or cluster.kind == "point" or noisy or angle[0] < max(SMALLEST_ANGLE_DEG, 3 * angle[1]):
        flags.append(Flag.COLOUR_CANNOT_SEPARATE)
    if line is None and body.seen:
        flags.append(Flag.NO_SPECULAR)
    bright = float(np.sqrt(np.mean(cloud.colour**2)))
    if cluster.kind == "volume" or (body.misfit > WORST_MISFIT and body.off_plane > WORST_OFF_PLANE * bright):
        flags.append(Flag.POOR_FIT)
    if body.bent:
        flags.append(Flag.MATTE_LINE_BENT)
    if clipped > CLIPPED_SHARE:
        flags.append(Flag.CLIPPED)
    return tuple(flags)


def _specular_error(found: Layers, light: Floats) -> float:
    """Relative rms error of the specular layer that its own covariance predicts."""
    some = slice(None, None, max(found.residual.size // 8192, 1))
    variance = found.covariance.reshape(-1, 3)[some, 2].astype(float)
    light_part = found.specular.reshape(-1, 3)[some] @ light
    sound = np.isfinite(variance) & np.isfinite(light_part)
    if not sound.any():
        return np.inf
    noise = float(variance[sound].mean())
    power = float((light_part[sound] ** 2).mean()) - noise
    return float(np.sqrt(noise / power)) if power > 0 else np.inf
