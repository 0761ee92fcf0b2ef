"""STEM.card.json: what the batch's page shows of one photograph beyond its result's numbers."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.records import Floats, MaterialReport, ModelLayers

if TYPE_CHECKING:
    from collections.abc import Sequence

SUFFIX = ".card.json"
SCHEMA = "fit-material/card/1"
SIDE_PX = 64  # of each of the three small pictures
QUALITY = 80
SIGMAS = 5.0  # ends of the residual's scale, as on the photograph's own page
MAX_BYTES = 1 << 18


def write_card(path: Path, report: MaterialReport, key: Mapping[str, str]) -> None:
    """Write the card of a report; `key` says of which photograph, settings and version it is."""
    told = {"schema": SCHEMA, **key, **_looks(report), "strip": _strip(report)}
    path.write_text(json.dumps(told, indent=1, ensure_ascii=True) + "\n", encoding="utf-8", newline="\n")


def read_card(path: Path) -> Mapping[str, Any]:
    """A card as written; empty where there is none that can be read."""
    from pipelines.report.stored import read_result

    found = read_result(path, max_bytes=MAX_BYTES)
    return found if found.get("schema") == SCHEMA else {}


def _looks(report: MaterialReport) -> dict[str, Any]:
    """The body's colour on a screen, and the highlight as the nearest GGX lobe's: a scale that all models share."""
    from pipelines.export.colour import srgb_hex
    from pipelines.export.material import material_of

    if not report.fits:
        return dict.fromkeys(("swatch", "alpha", "strength"))
    fit, material = report.fits[report.best], material_of(report)
    mean = {p.name: p.estimate for p in fit.parameters if p.estimate is not None}
    strength = mean.get("specular_strength", mean.get("specular_albedo", np.nan))
    return {
        "swatch": srgb_hex(material.f0 if material.metal else material.diffuse),
        "alpha": _number(material.ggx.alpha),
        "strength": _number(material.ggx.gain * np.mean(np.asarray(strength, float))),
    }


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _strip(report: MaterialReport) -> str | None:
    """Photograph, model and residual side by side, as a data: address; None where there are no layers."""
    from pipelines.report.figures.pictures import SCALE, sample_sd
    from pipelines.report.figures.shrink import shrunk
    from pipelines.report.figures.tone import tone_of

    layers = report.layers
    if layers is None:
        return None
    factor = max(1, -(-max(layers.diffuse.shape[:2]) // SIDE_PX))
    photograph, model, diffuse = (shrunk(part, factor) for part in (layers.photograph, layers.model, layers.diffuse))
    tone = tone_of(report, diffuse)
    sigmas = _sigmas(layers, factor, sample_sd(report, model))
    place = np.clip(np.nan_to_num(sigmas) / SIGMAS, -1, 1) * 2 + 2
    left = np.stack([np.interp(place, np.arange(5), SCALE[:, c]) for c in range(3)], axis=-1)
    seen = np.isfinite(model).all(axis=-1)
    parts = [tone.show(photograph), tone.show(model), left]
    return _webp([_square(np.dstack([part, seen.astype(float)])) for part in parts])


def _sigmas(layers: ModelLayers, factor: int, sd: Floats) -> Floats:
    """The residual over its noise, mean over channels and blocks."""
    from pipelines.report.figures.shrink import shrunk

    left = shrunk(np.where(layers.used, layers.residual, np.float32(np.nan)), factor) / sd
    seen = np.isfinite(left)
    mean = np.where(seen, left, 0.0).sum(axis=-1) / np.maximum(seen.sum(axis=-1), 1)
    return np.asarray(mean * np.sqrt(3.0) * factor)


def _square(picture: Floats) -> Floats:
    """In the middle of a transparent square."""
    h, w = min(picture.shape[0], SIDE_PX), min(picture.shape[1], SIDE_PX)
    square = np.zeros((SIDE_PX, SIDE_PX, 4))
    top, left = (SIDE_PX - h) // 2, (SIDE_PX - w) // 2
    square[top : top + h, left : left + w] = picture[:h, :w]
    return square


def _webp(squares: Sequence[Floats]) -> str:
    from PIL import Image

    pixels = np.round(255 * np.clip(np.concatenate(squares, axis=1), 0, 1)).astype(np.uint8)
    held = io.BytesIO()
    Image.fromarray(pixels).save(held, format="WEBP", quality=QUALITY, method=4)
    return "data:image/webp;base64," + base64.b64encode(held.getvalue()).decode("ascii")
