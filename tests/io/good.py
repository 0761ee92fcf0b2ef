"""Good files of every kind that is read, small, made here, and mutants of them."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np

from toolkit.io.dng import write_dng


def picture(height=48, width=64, *, seed=4):
    """A shaded, noisy RGB picture (H, W, 3) in 0..1."""
    y, x = np.mgrid[0:height, 0:width]
    shade = np.clip(1 - ((x - width / 2) ** 2 + (y - height / 2) ** 2) / (width / 2.2) ** 2, 0.02, 1)
    noise = np.random.default_rng(seed).normal(0, 0.01, (height, width, 3))
    return np.clip(shade[..., None] * [0.8, 0.5, 0.3] + noise, 0.001, 0.999)


def mosaic(height=48, width=64):
    """The picture's red, green / green, blue samples as 14-bit numbers over black 512."""
    rgb = picture(height, width)
    samples = np.empty((height, width))
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        samples[row::2, column::2] = rgb[row::2, column::2, channel]
    return (512 + samples * 15_000).round().astype(np.uint16)


def dng(path: Path, stored=None, **changes):
    """A Bayer DNG with EXIF and a noise profile."""
    told = {
        "cfa": "RGGB",
        "black": 512,
        "white": 15_871,
        "xyz_to_camera": np.array([[0.9, -0.2, -0.1], [-0.4, 1.2, 0.2], [-0.1, 0.2, 0.6]]),
        "as_shot_neutral": (0.5, 1.0, 0.7),
        "exposure_s": 1 / 60,
        "iso": 200,
        "f_number": 8.0,
        "focal_length_mm": 50.0,
        "noise_profile": [(1e-4, 1e-7), (2e-4, 2e-7), (3e-4, 3e-7)],
    }
    write_dng(path, mosaic() if stored is None else stored, **(told | changes))
    return path


def png(path: Path, values=None, chunks=()):
    """A PNG of unsigned integers, with further chunks (type, body) before its pixels."""
    import cv2

    stored = (picture() * 65_535).astype(np.uint16) if values is None else values
    _, coded = cv2.imencode(".png", stored[..., ::-1] if stored.ndim == 3 else stored)
    data = coded.tobytes()
    extra = b"".join(struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks)
    path.write_bytes(data[:33] + extra + data[33:])
    return path


def tiff(path: Path, values=None, **options):
    """An RGB TIFF."""
    import tifffile

    stored = (picture() * 65_535).astype(np.uint16) if values is None else values
    tifffile.imwrite(path, stored, photometric="rgb" if stored.ndim == 3 else "minisblack", **options)
    return path


def exr(path: Path, channels=None, header=None):
    """An EXR of float channels; OpenEXR changes the dictionary it is given."""
    import OpenEXR

    rgb = picture().astype(np.float32)
    stored = dict(channels) if channels else {name: np.ascontiguousarray(rgb[..., i]) for i, name in enumerate("RGB")}
    told = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | (header or {})
    with OpenEXR.File(told, stored) as file:
        file.write(str(path))
    return path


def radiance(path: Path, values=None):
    """A Radiance picture."""
    import cv2

    stored = picture().astype(np.float32) * 5 if values is None else values
    path.write_bytes(cv2.imencode(".hdr", np.ascontiguousarray(stored[..., ::-1]))[1].tobytes())
    return path


def tga(path: Path):
    """An 8-bit TGA."""
    from PIL import Image

    Image.fromarray((picture() * 255).astype(np.uint8)).save(path)
    return path


def all_kinds(folder: Path):
    """One good file of every kind."""
    return [
        dng(folder / "a.dng"),
        png(folder / "a.png"),
        tiff(folder / "a.tif"),
        tiff(folder / "z.tif", compression="zlib", predictor=True),
        exr(folder / "a.exr"),
        radiance(folder / "a.hdr"),
        tga(folder / "a.tga"),
    ]


def mutant(data: bytes, rng: np.random.Generator) -> bytes:
    """A file with a few bytes or a number changed (half of them in the header), a part zeroed or doubled, or cut."""
    changed = bytearray(data)
    kind = rng.integers(0, 10)
    reach = min(len(changed), 600) if rng.random() < 0.5 else len(changed)
    if kind <= 4:
        for _ in range(int(rng.integers(1, 9))):
            at = int(rng.integers(0, reach))
            changed[at] = int(rng.choice([0, 255, 127, 128, changed[at] ^ (1 << int(rng.integers(0, 8)))]))
        return bytes(changed)
    start = int(rng.integers(0, reach))
    stop = min(start + int(rng.integers(1, 200)), len(changed))
    if kind == 5:
        changed[start:stop] = bytes(stop - start)
    elif kind == 6:
        changed[start:start] = changed[start:stop]
    elif kind == 7:
        del changed[start + 1 :]
    else:
        _change_number(changed, start, rng)
    return bytes(changed)


def _change_number(data: bytearray, start: int, rng: np.random.Generator) -> None:
    """A length, count, offset or dimension that lies: two, four or eight bytes in either order of bytes."""
    size = int(rng.choice([2, 4, 8]))
    at = min(start, max(len(data) - size, 0))
    top = 1 << (8 * size)
    near = int.from_bytes(data[at : at + size], "little") + int(rng.integers(-2, 3))
    number = [0, 1, top - 1, top // 2, top // 2 - 1, near % top, int(rng.integers(0, 1 << 16))][int(rng.integers(0, 7))]
    data[at : at + size] = (number % top).to_bytes(size, "little" if rng.random() < 0.5 else "big")
