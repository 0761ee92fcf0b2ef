"""What a file tells of its making, from EXIF and DNG tags; what does not parse is left out with a note."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Iterable
from typing import Any

_PATIENCE_S = 3.0  # EXIF is a few hundred bytes: what takes longer runs in circles
_LONGEST_TEXT = 300
_MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # EXIF FocalPlaneResolutionUnit: inch, cm, mm, um
_TEXTS = {
    "make": "Image Make",
    "model": "Image Model",
    "lens": "EXIF LensModel",
    "software": "Image Software",
    "taken": "EXIF DateTimeOriginal",
}
_NUMBERS = {
    "exposure_s": "EXIF ExposureTime",
    "iso": "EXIF ISOSpeedRatings",
    "f_number": "EXIF FNumber",
    "focal_length_mm": "EXIF FocalLength",
    "focal_length_35mm_mm": "EXIF FocalLengthIn35mmFilm",
}
_MATRICES = {"xyz_to_camera": 50721, "xyz_to_camera_2": 50722, "forward_matrix": 50964, "forward_matrix_2": 50965}
_ILLUMINANTS = (50778, 50779)  # of calibration: EXIF LightSource
_AS_SHOT_NEUTRAL, _NOISE_PROFILE = 50728, 51041


def start(kind: str, path: str) -> Callable[[], dict[str, Any]]:
    """Begin to read the metadata of a file of this kind beside the decoding; the function returned waits for them.

    They are fields of `toolkit.records.Metadata` as JSON can carry them.
    """
    found: dict[str, Any] = {}
    notes: list[str] = []

    def read() -> None:
        for name, source in _SOURCES.get(kind, {}).items():
            try:
                found.update(source(path))
            except Exception as error:  # a parser of untrusted tags may raise anything: go on without
                notes.append(f"{name} left out: {type(error).__name__}: {plain_text(error)}")

    reader = threading.Thread(target=read, daemon=True)
    reader.start()

    def wait() -> dict[str, Any]:
        reader.join(_PATIENCE_S)
        late = ["metadata left out: reading them took too long"] if reader.is_alive() else []
        return {**found, "notes": notes + late}

    return wait


def plain_text(value: object) -> str:
    """Untrusted text on one line, printable, of bounded length."""
    kept = "".join(letter if letter.isprintable() else " " for letter in str(value))
    return " ".join(kept.split())[:_LONGEST_TEXT]


def _exif(path: str) -> dict[str, Any]:
    import exifread

    logging.getLogger("exifread").setLevel(logging.CRITICAL)  # it complains of files without EXIF
    with open(path, "rb") as file:  # noqa: PTH123  # pathlib costs the child's start-up
        tags = exifread.process_file(file, details=False)
    texts = {name: plain_text(tags[key]) for name, key in _TEXTS.items() if key in tags}
    numbers = {name: number for name, key in _NUMBERS.items() if (number := _positive(tags.get(key))) is not None}
    return {**texts, **numbers, **_focal_plane(tags)}


def _positive(tag: object) -> float | None:
    """The first value of a tag as a positive number; None where it is none."""
    values: Any = getattr(tag, "values", None)
    try:
        number = float(values[0])  # a TypeError where there is nothing to index
    except (TypeError, ValueError, IndexError, ZeroDivisionError, OverflowError, KeyError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _focal_plane(tags: dict[str, Any]) -> dict[str, float]:
    per_unit = _positive(tags.get("EXIF FocalPlaneXResolution"))
    unit = _positive(tags.get("EXIF FocalPlaneResolutionUnit")) or 2.0
    if per_unit is None or int(unit) not in _MM_PER_UNIT:
        return {}
    return {"focal_plane_resolution_px_per_mm": per_unit / _MM_PER_UNIT[int(unit)]}


def _dng(path: str) -> dict[str, Any]:
    """The noise profile and colour tags of a DNG; nothing for any other file."""
    with open(path, "rb") as file:  # noqa: PTH123  # as above
        if file.read(2) not in (b"II", b"MM"):
            return {}
    import tifffile

    with tifffile.TiffFile(path) as tiff:
        page = tiff.pages.first
        directories = [page, *(page.pages or [])]
        profile = _tag(directories, _NOISE_PROFILE)
        matrices = {name: _three_rows(_rationals(_tag(directories, tag))) for name, tag in _MATRICES.items()}
        neutral = _rationals(_tag(directories, _AS_SHOT_NEUTRAL))
        lights = [int(value[0]) for value in (_tag(directories, tag) for tag in _ILLUMINANTS) if value]
    found = {
        **matrices,
        "noise_profile": _pairs(profile),
        "as_shot_neutral": neutral if len(neutral) == 3 and all(n > 0 for n in neutral) else [],
        "calibration_illuminants": lights,
    }
    return {name: value for name, value in found.items() if value}


def _tag(directories: Iterable[Any], number: int) -> tuple[Any, ...]:
    for directory in directories:
        if number in directory.tags:
            value = directory.tags[number].value
            return value if isinstance(value, tuple) else (value,)
    return ()


def _three_rows(numbers: list[float]) -> list[list[float]]:
    return [numbers[i : i + 3] for i in (0, 3, 6)] if len(numbers) == 9 else []


def _rationals(value: tuple[Any, ...]) -> list[float]:
    """Numerators and denominators in turn, as tifffile gives them, divided; empty where one divides by zero."""
    numbers = [float(item) for item in value]
    if len(numbers) % 2 or any(number == 0 for number in numbers[1::2]):
        return []
    return [numerator / denominator for numerator, denominator in zip(numbers[::2], numbers[1::2], strict=True)]


def _pairs(value: tuple[Any, ...]) -> list[list[float]]:
    """Scale and offset of each plane; empty where they are no usable numbers."""
    numbers = [float(item) for item in value]
    usable = len(numbers) in (2, 6, 8) and all(math.isfinite(number) for number in numbers)
    if not usable or any(scale <= 0 for scale in numbers[::2]):
        return []
    return [[scale, max(offset, 0.0)] for scale, offset in zip(numbers[::2], numbers[1::2], strict=True)]


_SOURCES = {"raw": {"EXIF": _exif, "DNG tags": _dng}, "tiff": {"EXIF": _exif}, "image": {"EXIF": _exif}}
