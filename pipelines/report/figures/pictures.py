"""Photograph, diffuse, specular, model, and what is left: all by one tone curve, shrunk by block means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, MaterialReport

from .png import data_uri
from .shrink import Small
from .tone import Tone

# a diverging scale from blue over near-white to red, readable without colour vision (Moreland 2009, coarsened)
SCALE = np.array([[0.13, 0.30, 0.68], [0.48, 0.66, 0.90], [0.94, 0.94, 0.94], [0.95, 0.60, 0.47], [0.70, 0.05, 0.15]])
LIT = 0.02  # of the brightest: below it a percentage says nothing
SIGMAS = 5.0  # of the picture's own noise: the ends of the residual's scale


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture of the page; `low` and `high` label the ends of its colour scale, where it has one."""

    title: str
    alt: str
    caption: str
    uri: str
    width_px: int
    height_px: int
    low: str = ""
    high: str = ""


def pictures(report: MaterialReport, layers: Small, tone: Tone) -> list[Picture]:
    """The six pictures of the best fit."""
    return [
        _plain("Photograph", "what the camera measured", layers.photograph, tone),
        _plain("Diffuse", "light that entered the body and took its colour", layers.diffuse, tone),
        _plain("Specular", "light mirrored at the surface", layers.specular, tone),
        _plain("Model", "diffuse + specular + pedestal", layers.model, tone),
        _residual_sigmas(report, layers),
        _residual_percent(layers),
    ]


def _plain(title: str, caption: str, radiance: Floats, tone: Tone) -> Picture:
    seen = np.asarray(np.isfinite(radiance).all(axis=-1))
    return Picture(
        title=title,
        alt=f"{title}: {caption}",
        caption=caption,
        uri=data_uri(tone.show(radiance), seen),
        width_px=radiance.shape[1],
        height_px=radiance.shape[0],
    )


def sample_sd(report: MaterialReport, model: Floats) -> Floats:
    """Noise sd (h, w, 3) of one sample of the layers: a quad's green is the mean of as many planes as are green."""
    planes = np.bincount([plane.channel for plane in report.image.planes], minlength=3)[:3]
    variance = [report.image.noise.variance(model[..., c], c) / max(planes[c], 1) for c in range(3)]
    return np.asarray(np.sqrt(np.stack(variance, axis=-1)))


def _residual_sigmas(report: MaterialReport, layers: Small) -> Picture:
    """Each mean over its own noise: three channels of factor^2 samples."""
    left = layers.residual / sample_sd(report, layers.model)
    value = _mean_channel(left) * np.sqrt(3.0) * layers.factor
    each = (
        f"each pixel is the mean of {layers.factor} × {layers.factor} samples" if layers.factor > 1 else "every sample"
    )
    return _signed("Residual, in noise sd", f"photograph − model over the noise; {each}", value, SIGMAS, "σ")


def _residual_percent(layers: Small) -> Picture:
    residual = _mean_channel(layers.residual)
    model = _mean_channel(np.where(np.isfinite(layers.residual), layers.model, np.nan))
    bright = float(np.nanmax(model)) if np.isfinite(model).any() else 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.where(model > LIT * bright, 100.0 * residual / model, np.nan)
    ends = _round_up(float(np.nanpercentile(np.abs(value), 97))) if np.isfinite(value).any() else 1.0
    caption = "photograph − model over the model, where there is light"
    return _signed("Residual, in % of the model", caption, value, ends, "%")


def _mean_channel(values: Floats) -> Floats:
    seen = np.isfinite(values)
    count = seen.sum(axis=-1)
    return np.asarray(np.where(count > 0, np.where(seen, values, 0.0).sum(axis=-1) / np.maximum(count, 1), np.nan))


def _round_up(value: float) -> float:
    """To 1, 2 or 5 times a power of ten."""
    if not value > 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9)))


def _signed(title: str, caption: str, value: Floats, ends: float, unit: str) -> Picture:
    seen = np.asarray(np.isfinite(value))
    place = np.clip(np.where(seen, value, 0.0) / ends, -1.0, 1.0) * 2 + 2
    rgb = np.stack([np.interp(place, np.arange(5), SCALE[:, c]) for c in range(3)], axis=-1)
    return Picture(
        title=title,
        alt=f"{title}: {caption}; blue where the photograph is darker than the model, red where brighter",
        caption=caption,
        uri=data_uri(rgb, seen),
        width_px=value.shape[1],
        height_px=value.shape[0],
        low=f"−{ends:g} {unit}",
        high=f"+{ends:g} {unit}",
    )
