"""A Bayer mosaic written as DNG: uncompressed 16 bits, one strip, a real EXIF directory, every number exact.

Adobe, Digital Negative Specification 1.4.0.0; read back bit for bit by rawpy, dcraw, tifffile, ExifRead, exiftool.
"""

from __future__ import annotations

import os
import struct
import uuid
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .ifd import Entry, numbers, opaque, serialise, size, text

Cfa = Literal["RGGB", "BGGR", "GRBG", "GBRG"]
_STRIP_OFFSET, _EXIF = 273, 34665
_HEADER = 8  # "II", 42, offset of the first directory


def write_dng(
    path: str | os.PathLike[str],
    mosaic: NDArray[np.uint16],
    *,
    cfa: Cfa,
    black: ArrayLike,
    white: int,
    xyz_to_camera: ArrayLike,
    as_shot_neutral: ArrayLike,
    exposure_s: float,
    iso: int,
    f_number: float,
    focal_length_mm: float,
    focal_plane_px_per_mm: float | None = None,
    noise_profile: ArrayLike | None = None,
    orientation: int = 1,
    crop: tuple[int, int, int, int] | None = None,
    make: str = "Synthetic",
    model: str = "Camera",
    lens: str = "",
    software: str = "fit-material",
    taken: str = "2000:01:01 00:00:00",
) -> None:
    """Write a mosaic (H, W) as DNG; the file appears whole or not at all.

    `cfa` names the channels at (0, 0), (0, 1), (1, 0), (1, 1). `black` is one level, or four in the same order,
    in DN; `white` the level of saturation, DN. `noise_profile` (3, 2) holds scale and offset of red, green, blue:
    variance = scale * signal + offset with the signal in 0..1 between black and white (one pair serves all three).
    `xyz_to_camera` (3, 3) is ColorMatrix1 under D65; `as_shot_neutral` (3,) a neutral object's camera colour.
    `orientation` is EXIF's 1..8. `crop` is DefaultCrop as x, y, width, height (default: the whole mosaic).
    Raises ValueError on a mosaic or numbers that a DNG cannot hold.
    """
    pixels = _pixels(mosaic)
    height, width = pixels.shape
    main = (
        _layout(width, height, pixels.nbytes, orientation)
        | _mosaic(cfa, black, white, crop or (0, 0, width, height), width, height)
        | _colour(xyz_to_camera, as_shot_neutral, noise_profile)
        | _names(make, model, software, taken)
    )
    exif = _exif(exposure_s, iso, f_number, lens, taken) | _focal(focal_length_mm, focal_plane_px_per_mm)
    _write_whole(Path(path), _head(main, exif), np.ascontiguousarray(pixels, dtype="<u2").data)


def _pixels(mosaic: NDArray[Any]) -> NDArray[Any]:
    values = np.asarray(mosaic)
    if values.dtype != np.uint16 or values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"mosaic is {values.dtype} of shape {values.shape}; expected uint16 of shape (H, W)")
    return values


def _layout(width: int, height: int, byte_count: int, orientation: int) -> dict[int, Entry]:
    """What any TIFF reader needs."""
    if orientation not in range(1, 9):
        raise ValueError(f"orientation is {orientation}; expected EXIF's 1 to 8")
    return {
        254: numbers("long", 0),  # NewSubfileType: the full-resolution image
        256: numbers("long", width),
        257: numbers("long", height),
        258: numbers("short", 16),  # BitsPerSample
        259: numbers("short", 1),  # Compression: none (LibRaw refuses a deflated mosaic)
        262: numbers("short", 32803),  # PhotometricInterpretation: colour filter array
        _STRIP_OFFSET: numbers("long", 0),  # known once both directories are laid out
        274: numbers("short", orientation),
        277: numbers("short", 1),  # SamplesPerPixel
        278: numbers("long", height),  # RowsPerStrip
        279: numbers("long", byte_count),
        284: numbers("short", 1),  # PlanarConfiguration
    }


def _mosaic(
    cfa: Cfa, black: ArrayLike, white: int, crop: tuple[int, int, int, int], width: int, height: int
) -> dict[int, Entry]:
    """Where each colour's pixels lie and between which levels they count."""
    if cfa not in get_args(Cfa):
        raise ValueError(f"cfa is {cfa!r}; expected one of {', '.join(get_args(Cfa))}")
    levels = np.broadcast_to(np.asarray(black, float).ravel(), (4,))
    if levels.min() < 0 or not levels.max() < white <= 65535:
        raise ValueError(f"black {levels.tolist()} and white {white}; expected 0 <= black < white <= 65535")
    x, y, across, down = crop
    if x < 0 or y < 0 or across < 1 or down < 1 or x + across > width or y + down > height:
        raise ValueError(f"crop {crop} does not lie inside the mosaic of {width} x {height} px")
    return {
        33421: numbers("short", 2, 2),  # CFARepeatPatternDim
        33422: numbers("byte", *("RGB".index(colour) for colour in cfa)),
        50710: numbers("byte", 0, 1, 2),  # CFAPlaneColor
        50711: numbers("short", 1),  # CFALayout: rectangular
        50713: numbers("short", 2, 2),  # BlackLevelRepeatDim
        50714: numbers("rational", *levels.tolist()),
        50717: numbers("long", white),
        50719: numbers("long", x, y),  # DefaultCropOrigin
        50720: numbers("long", across, down),
        50829: numbers("long", 0, 0, height, width),  # ActiveArea: top, left, bottom, right
    }


def _colour(xyz_to_camera: ArrayLike, as_shot_neutral: ArrayLike, noise_profile: ArrayLike | None) -> dict[int, Entry]:
    """The camera's colours and noise."""
    tags = {
        50721: numbers("srational", *np.reshape(np.asarray(xyz_to_camera, float), 9).tolist()),  # ColorMatrix1
        50728: numbers("rational", *np.reshape(np.asarray(as_shot_neutral, float), 3).tolist()),
        50778: numbers("short", 21),  # CalibrationIlluminant1: D65
    }
    if noise_profile is not None:
        pairs = np.broadcast_to(np.asarray(noise_profile, float), (3, 2))
        if not np.isfinite(pairs).all() or pairs.min() < 0:
            raise ValueError(f"noise_profile is {pairs.tolist()}; expected scales and offsets of 0 or more")
        tags[51041] = numbers("double", *pairs.ravel().tolist())
    return tags


def _names(make: str, model: str, software: str, taken: str) -> dict[int, Entry]:
    return {
        271: text(make),
        272: text(model),
        305: text(software),
        306: text(taken),
        50706: numbers("byte", 1, 4, 0, 0),  # DNGVersion
        50707: numbers("byte", 1, 1, 0, 0),  # DNGBackwardVersion
        50708: text(f"{make} {model}"),  # UniqueCameraModel
    }


def _exif(exposure_s: float, iso: int, f_number: float, lens: str, taken: str) -> dict[int, Entry]:
    """The EXIF directory proper: readers take ISO from nowhere else."""
    tags = {
        33434: numbers("rational", exposure_s),
        33437: numbers("rational", f_number),
        34855: numbers("short", iso),
        36864: opaque(b"0231"),  # ExifVersion
        36867: text(taken),  # DateTimeOriginal
    }
    return tags | ({42036: text(lens)} if lens else {})


def _focal(focal_length_mm: float, px_per_mm: float | None) -> dict[int, Entry]:
    """The focal length, and the pixels' pitch that turns it into pixels."""
    tags = {37386: numbers("rational", focal_length_mm)}
    if px_per_mm is not None:
        per_cm = numbers("rational", 10.0 * px_per_mm)
        tags |= {41486: per_cm, 41487: per_cm, 41488: numbers("short", 3)}  # FocalPlaneResolution, per centimetre
    return tags


def _head(main: dict[int, Entry], exif: dict[int, Entry]) -> bytes:
    """Header and both directories, with the offsets to the EXIF directory and to the pixels filled in."""
    main = main | {_EXIF: numbers("long", 0)}
    exif_at = _HEADER + size(main)
    pixels_at = (exif_at + size(exif) + 15) // 16 * 16
    main |= {_EXIF: numbers("long", exif_at), _STRIP_OFFSET: numbers("long", pixels_at)}
    head = b"II*\0" + struct.pack("<I", _HEADER) + serialise(main, _HEADER) + serialise(exif, exif_at)
    return head.ljust(pixels_at, b"\0")


def _write_whole(path: Path, head: bytes, pixels: memoryview) -> None:
    """Write beside the target and rename, so that no reader meets half a file."""
    part = path.with_name(f".{path.name}.{uuid.uuid4().hex}.part")
    try:
        with part.open("xb") as file:
            file.write(head)
            file.write(pixels)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
