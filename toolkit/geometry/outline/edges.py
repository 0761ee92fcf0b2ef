"""Edge points with their directions, at a resolution where a photograph is quickly searched."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgePoints:
    """Edge points in samples of the picture they come from; `direction` is the unit gradient of brightness."""

    place: Floats  # (N, 2) column, row
    direction: Floats  # (N, 2)

    def __post_init__(self) -> None:
        readonly(self)


def even_noise(picture: Floats, gain: Floats, read: Floats) -> Floats:
    """Brightness (h, w, c) on a scale where noise has sd 1: Anscombe's square root, generalised.

    `gain` and `read` (c,) are those of `Noise`. Source: Anscombe 1948; Murtagh, Starck & Bijaoui 1995.
    """
    g, r = np.float32(np.maximum(gain, 1e-12)), np.float32(read)
    return np.asarray(2.0 / g * np.sqrt(np.maximum(g * picture + 0.375 * g * g + r * r, 0.0)))


def edge_points(even: Floats, *, threshold: float, most: int, rng: np.random.Generator) -> EdgePoints:
    """Canny's edge points of a picture (h, w, c) with noise of sd 1; the strongest channel decides at each place."""
    import cv2

    smooth = cv2.GaussianBlur(np.asarray(even, np.float32), (0, 0), 1.0).reshape(*even.shape[:2], -1)
    gx, gy = (
        np.stack([cv2.Scharr(smooth[..., c], cv2.CV_32F, *d) for c in range(smooth.shape[2])], axis=-1) / 32.0
        for d in ((1, 0), (0, 1))
    )
    strongest = np.argmax(gx * gx + gy * gy, axis=-1)[..., None]
    gx, gy = (np.take_along_axis(g, strongest, axis=-1)[..., 0] for g in (gx, gy))
    scale = 32000.0 / max(float(np.abs(gx).max()), float(np.abs(gy).max()), 64.0 * threshold)
    as_int = [np.asarray(g * scale, np.int16) for g in (gx, gy)]
    found = cv2.Canny(as_int[0], as_int[1], threshold * scale, 2.5 * threshold * scale, L2gradient=True)
    rows, columns = np.nonzero(found)
    if len(rows) > most:
        keep = rng.choice(len(rows), most, replace=False)
        rows, columns = rows[keep], columns[keep]
    direction = np.stack([gx[rows, columns], gy[rows, columns]], axis=-1).astype(float)
    length = np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-12)
    return EdgePoints(place=np.stack([columns, rows], axis=-1).astype(float), direction=direction / length)
