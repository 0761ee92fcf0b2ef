"""An examination as one JSON object."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from pipelines.report.result import finite
from pipelines.report.text import base_name, clean
from toolkit.records import RawFrame

from .records import Examination

SCHEMA = "fit-material/doctor/1"


def as_object(found: Examination) -> dict[str, Any]:
    """All keys always; what was not found is null."""
    made = {
        "schema": SCHEMA,
        "status": "ok" if found.error is None else "failed",
        "error": None if found.error is None else clean(found.error),
        "flags": list(found.flags),
        "image": _image(found.frame),
        "exposure": _plain(found.exposure),
        "noise": _noise(found),
        "camera": None if found.scene is None else _plain(found.scene.camera),
        "sphere": _sphere(found),
        "surroundings": _plain(found.surroundings),
        "light": _plain(found.lamp),
        "advice": [asdict(one) for one in found.advice],
    }
    return {key: finite(value) for key, value in made.items()}


def _plain(record: object) -> dict[str, Any] | None:
    return None if record is None else {item.name: getattr(record, item.name) for item in fields(record)}  # type: ignore[arg-type]  # dataclasses


def _image(frame: RawFrame) -> dict[str, Any]:
    height, width = frame.values.shape[:2]
    metadata = frame.metadata
    return {
        "name": base_name(frame.name),
        "sha256": frame.sha256,
        "width_px": width,
        "height_px": height,
        "format": frame.format,
        "encoding": frame.encoding,
        "mosaic": frame.cfa is not None,
        "camera": clean(f"{metadata.make} {metadata.model}").strip(),
        "lens": clean(metadata.lens),
        "taken": clean(metadata.taken),
        **{name: getattr(metadata, name) for name in ("exposure_s", "iso", "f_number", "focal_length_mm")},
        "black": frame.black,
        "white": frame.white,
        "notes": [clean(note) for note in metadata.notes],
    }


def _noise(found: Examination) -> dict[str, Any] | None:
    if found.image is None:
        return None
    gain_sd, read_sd = found.noise_sd or (None, None)
    noise = found.image.noise
    return {"gain": noise.gain, "read": noise.read, "gain_sd": gain_sd, "read_sd": read_sd, "source": noise.source}


def _sphere(found: Examination) -> dict[str, Any] | None:
    if found.scene is None:
        return None
    sphere = found.scene.sphere
    return {
        "centre_px": sphere.centre_px,
        "radius_px": sphere.radius_px,
        "source": sphere.source,
        "sd": np.sqrt(np.diag(sphere.covariance_px2)),
    }
