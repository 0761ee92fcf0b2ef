"""What a reader of the layers must know: the flags of a separation by colour."""

from __future__ import annotations

import numpy as np

from toolkit.flags import Flag

from .body import Body
from .cluster import Cluster
from .highlight import HighlightLine
from .projection import Layers
from .samples import Blocks, Samples

SMALLEST_ANGLE_DEG = 3.0  # below it, 1 % noise leaves 60 % error in the specular layer
WORST_SPECULAR = 0.5  # relative rms error of the specular layer that noise alone would leave
WORST_MISFIT = 3.0  # of the blocks' distance from the plane, over the noise, where it also is ...
WORST_OFF_PLANE = 0.02  # ... this part of the brightness: a second hue, or a picture that is not linear
CLIPPED_SHARE = 0.01


def verdict(
    ready: Samples,
    cloud: Blocks,
    cluster: Cluster,
    body: Body,
    line: HighlightLine | None,
    found: Layers,
    angle: tuple[float, float],
) -> tuple[Flag, ...]:
    """Flags of a separation; `angle` between body and light, and its sd, degrees."""
    clipped = 1 - np.count_nonzero(ready.weight) / np.count_nonzero(ready.on_sphere)
    said = {
        Flag.COLOUR_CANNOT_SEPARATE: _cannot_separate(cluster, body, line, _specular_error(found), angle),
        Flag.NO_SPECULAR: line is None and body.seen,
        Flag.POOR_FIT: cluster.kind == "volume" or _off_plane(cloud, body),
        Flag.MATTE_LINE_BENT: body.bent,
        Flag.CLIPPED: clipped > CLIPPED_SHARE,
        Flag.HIGHLIGHT_CLIPPED: clipped > 0 and _blind(ready),
    }
    return tuple(flag for flag, holds in said.items() if holds)


def _cannot_separate(
    cluster: Cluster, body: Body, line: HighlightLine | None, specular_error: float, angle: tuple[float, float]
) -> bool:
    if not body.seen or cluster.kind == "point":
        return True
    return angle[0] < max(SMALLEST_ANGLE_DEG, 3 * angle[1]) or (line is not None and specular_error > WORST_SPECULAR)


def _off_plane(cloud: Blocks, body: Body) -> bool:
    bright = float(np.sqrt(np.mean(cloud.colour**2)))
    return body.misfit > WORST_MISFIT and body.off_plane > WORST_OFF_PLANE * bright


def _blind(ready: Samples) -> bool:
    """Whether any pixel on the sphere has no usable channel at all."""
    seen = ready.usable[..., 0] | ready.usable[..., 1] | ready.usable[..., 2]
    return bool(np.any(ready.on_sphere & ~seen))


def _specular_error(found: Layers) -> float:
    """Relative rms error of the specular layer that its own covariance predicts."""
    some = slice(None, None, max(found.residual.size // 8192, 1))
    variance = found.covariance[..., 2].ravel()[some].astype(float)
    light_part = found.along_light.ravel()[some].astype(float)
    sound = np.isfinite(variance) & np.isfinite(light_part)
    if not sound.any():
        return np.inf
    noise = float(variance[sound].mean())
    power = float((light_part[sound] ** 2).mean()) - noise
    return float(np.sqrt(noise / power)) if power > 0 else np.inf
