"""Light that the camera itself throws beside a clipped highlight: found before any fit, by no model of the surface.

Lens and sensor draw rays and smears out of whatever is bright enough to clip; a fit takes them for the material. What
an isotropic surface shows there is smooth: under one lamp radiance depends on the cosines of normal, light and view
alone, so it is symmetric about the plane of light and view, and about the highlight's middle it falls off alike all
around but for slow waves (Fresnel, masking, the body's shading; an ellipse where the lamp or the lobe makes one). What
stands out above that (`smooth_lobe`), in a piece that reaches the clipped core, is glare.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from toolkit.flags import SampleFlag, flagged
from toolkit.records import Floats, Light, LinearImage, Noise, Plane, Scene

from .project import mirror_place, project
from .smooth_lobe import smooth_lobe
from .sphere import Surface, surface

EXCESS = 0.15  # over the smooth lobe, as a share of it, from which a sample stands out
SKIRT = 0.05  # down to which samples beside such ones go with them
NOISE_SDS = 4.0  # of a sample, that it must stand out by as well
SCATTERS = 4.0  # and times the median deviation of samples at the same distance from the middle
SAME = 31  # samples that are at the same distance
ASIDE = 0.25  # samples, by which a lobe may lie elsewhere
REACH = 8.0  # radii of the clipped core, from its middle
MOST_REACH_RAD = 0.26  # beyond 15 degrees of the surface the body's shading is no longer slow
CORE_RAD = 0.2  # between where a lamp should be mirrored and where it clips, at most
LEAST_COSINE = 0.1  # of light and view: nearer terminator and limb nothing is slow
FEWEST, MOST = 60, 3000  # samples that a smooth lobe is told by

Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


def without_glare(image: LinearImage, scene: Scene) -> LinearImage:
    """The photograph with those samples flagged that glare brightens; itself where there are none.

    Only what lies about a clipped highlight is looked at, to `REACH` radii of its core, 15 degrees at most; where
    another lamp is mirrored nearby, no further than halfway to it.
    """
    found = [np.zeros(plane.flags.shape, bool) for plane in image.planes]
    for core in _cores(image, scene):
        for plane, mask in zip(image.planes, found, strict=True):
            box = _box(plane, scene, core)
            mask[box] |= _glare(_cut(plane, box), image.noise, scene, core)
    if not any(mask.any() for mask in found):
        return image
    kind = np.uint8(SampleFlag.GLARE)
    planes = [replace(plane, flags=plane.flags | kind * mask) for plane, mask in zip(image.planes, found, strict=True)]
    return replace(image, planes=tuple(planes))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Core:
    """A clipped highlight of a lamp: the normal (3,) in its middle, and how far from there glare is looked for."""

    light: Light
    middle: Floats
    reach_rad: float


def _cores(image: LinearImage, scene: Scene) -> Iterator[_Core]:
    clipped = np.concatenate([_clipped_normals(plane, scene) for plane in image.planes])
    places = [(light, mirror_place(scene.camera, scene.sphere, light)) for light in scene.lights]
    mirrored = [(light, place) for light, place in places if place is not None]
    if not len(clipped) or not mirrored:
        return
    mirrors = np.array([place for _, place in mirrored])
    apart = _angles(clipped, mirrors)
    pixel_rad = image.planes[0].step_px / scene.sphere.radius_px
    for v, (light, _) in enumerate(mirrored):
        mine = clipped[(apart[:, v] < CORE_RAD) & (apart.argmin(axis=1) == v)]
        if len(mine):
            middle = mine.mean(axis=0) / np.linalg.norm(mine.mean(axis=0))
            radius = float(np.quantile(_angles(mine, middle[None]), 0.9)) + 0.5 * pixel_rad
            halfway = 0.5 * _angles(np.delete(mirrors, v, axis=0), middle[None]).ravel()
            yield _Core(light=light, middle=middle, reach_rad=min(REACH * radius, MOST_REACH_RAD, *halfway))


def _clipped_normals(plane: Plane, scene: Scene) -> Floats:
    clipped = np.flatnonzero(flagged(plane.flags, SampleFlag.CLIPPED))
    row, column = np.unravel_index(clipped, plane.flags.shape)
    seen = _seen(plane, scene, row, column)
    return np.asarray(seen.normal[seen.on_sphere])


def _seen(plane: Plane, scene: Scene, row: Rows, column: Rows) -> Surface:
    (x0, y0), step = plane.origin_px, plane.step_px
    return surface(scene.camera, scene.sphere, x0 + step * column, y0 + step * row)


def _angles(a: Floats, b: Floats) -> Floats:
    """Angles (N, M) between unit vectors (N, 3) and (M, 3)."""
    chord = np.linalg.norm(a[:, None] - b[None], axis=-1)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def _box(plane: Plane, scene: Scene, core: _Core) -> tuple[slice, slice]:
    """The part of a plane that holds a core's reach."""
    x, y = project(scene.camera, scene.sphere, core.middle[None])[0]
    column, row = ((at - origin) / plane.step_px for at, origin in zip((x, y), plane.origin_px, strict=True))
    reach = 1.2 * core.reach_rad * scene.sphere.radius_px / plane.step_px  # perspective stretches by less
    first = [max(int(np.floor(at - reach)), 0) for at in (row, column)]
    end = [max(int(np.ceil(at + reach)) + 1, 0) for at in (row, column)]
    return slice(first[0], end[0]), slice(first[1], end[1])


def _cut(plane: Plane, box: tuple[slice, slice]) -> Plane:
    x0, y0 = plane.origin_px
    origin = (x0 + plane.step_px * box[1].start, y0 + plane.step_px * box[0].start)
    return replace(plane, values=plane.values[box], flags=plane.flags[box], origin_px=origin)


def _glare(plane: Plane, noise: Noise, scene: Scene, core: _Core) -> Mask:
    """Which samples of a plane (h, w) about a core glare brightens."""
    row, column = (index.ravel() for index in np.indices(plane.flags.shape))
    seen, excess = _seen(plane, scene, row, column), np.zeros(plane.flags.shape)
    angle, towards = _angles(seen.normal, core.middle[None])[:, 0], core.light.at(seen.normal)[0]
    use = seen.on_sphere & (angle < core.reach_rad) & (plane.values.ravel() > 0.0)
    use &= ~flagged(plane.flags.ravel(), SampleFlag.CLIPPED | SampleFlag.INVALID)
    for direction in (towards, seen.view):
        use &= np.einsum("ni,ni->n", seen.normal, direction) > LEAST_COSINE
    if np.count_nonzero(use) >= FEWEST:
        value = plane.values.ravel()[use].astype(float)
        around = _around(seen.normal[use], core.middle, towards[use].mean(axis=0))
        lobe = smooth_lobe(angle[use], around, value, excess=EXCESS, most=MOST)
        smooth, aside = lobe(angle[use], around), ASIDE * plane.step_px / scene.sphere.radius_px
        allowed = NOISE_SDS * np.sqrt(noise.variance(smooth, plane.channel))
        allowed = np.maximum(allowed, SCATTERS * _scatter(angle[use], value / smooth - 1.0) * smooth)
        steep = np.maximum(lobe(np.maximum(angle[use] - aside, 1e-9), around), smooth)
        excess.ravel()[use] = np.where(value - smooth > allowed, value / steep - 1.0, 0.0)
    return _reaching(excess, flagged(plane.flags, SampleFlag.CLIPPED))


def _scatter(angle: Floats, deviation: Floats) -> Floats:
    """Median absolute deviation (N,) of the samples that are about as far from the middle."""
    from scipy.ndimage import median_filter

    order = np.argsort(angle)
    found = np.empty(len(angle))
    found[order] = median_filter(np.abs(deviation[order]), SAME, mode="nearest")
    return found


def _around(normal: Floats, middle: Floats, towards: Floats) -> Floats:
    """Azimuth (N,) of normals about the middle one, from the plane that it spans with the direction of the light."""
    across = np.cross(middle, towards)
    length = float(np.linalg.norm(across))
    across = across / length if length > 1e-6 else np.cross(middle, np.eye(3)[int(np.argmin(np.abs(middle)))])
    return np.asarray(np.arctan2(normal @ across, normal @ np.cross(across, middle)))


def _reaching(excess: Floats, clipped: Mask) -> Mask:
    """Where samples (h, w) stand out in a piece that reaches what is clipped, with their skirts."""
    import cv2

    out = excess > EXCESS
    if not out.any():
        return np.asarray(out)
    square = np.ones((3, 3), np.uint8)
    beside = cv2.dilate(clipped.astype(np.uint8), square, iterations=2) > 0
    _, pieces = cv2.connectedComponents((out | beside).astype(np.uint8), connectivity=8)
    glare = out & np.isin(pieces, pieces[beside])
    return np.asarray(glare | ((excess > SKIRT) & (cv2.dilate(glare.astype(np.uint8), square) > 0)))
