"""Decoding a file of known kind in this very process: decoder, limit on the pixels, check of the numbers."""

from __future__ import annotations

import os
from collections.abc import Callable

from toolkit.errors import BadInputError
from toolkit.io.decoded import CheckSize, Decoded, Limits


def decode(kind: str, path: str, limits: Limits) -> Decoded:
    """The file's pixels, checked to be a photograph, and its metadata.

    Raises BadInputError, whatever a decoder raises.
    """
    from toolkit.io import metadata, plausible

    file_bytes = os.path.getsize(path)  # noqa: PTH202  # pathlib costs the child's start-up
    reading = metadata.start(kind, path)
    try:
        decoded = _decoder(kind)(path, size_checker(limits, file_bytes))
        plausible.check(decoded, file_bytes)
    except BadInputError:
        raise
    except MemoryError as error:
        allowed = limits.memory_for(file_bytes) / 1e9
        raise BadInputError(f"decoding takes more than {allowed:.1f} GB; the file is damaged or too large") from error
    except Exception as error:  # a decoder may raise anything on a damaged file
        reason = metadata.plain_text(str(error).replace(path, "it")) or type(error).__name__
        raise BadInputError(f"the {kind} decoder fails on it ({reason}); copy or export it again") from error
    read = reading()
    notes = [*decoded.metadata.get("notes", []), *read.pop("notes")]
    return decoded._replace(metadata={**decoded.metadata, **read, "notes": notes})


def _decoder(kind: str) -> Callable[[str, CheckSize], Decoded]:
    from toolkit.io import exr, raster, raw, tiff

    return {
        "raw": raw.decode,
        "exr": exr.decode,
        "png": raster.decode_png,
        "tiff": tiff.decode,
        "hdr": raster.decode_radiance,
        "image": raster.decode_other,
    }[kind]


def size_checker(limits: Limits, file_bytes: int) -> CheckSize:
    """A function of (width, height, bytes a pixel) that raises BadInputError where decoding would cost too much."""

    def check_size(width: int, height: int, pixel_bytes: int) -> None:
        pixels, decoded = width * height, width * height * pixel_bytes
        if width < 1 or height < 1:
            raise BadInputError(f"it claims {width} x {height} pixels; the file is damaged: copy or export it again")
        if pixels > limits.pixels:
            raise BadInputError(
                f"it claims {width} x {height} pixels; at most {limits.pixels / 1e6:.0f} million are decoded: crop it"
            )
        if decoded > max(limits.expansion_free_bytes, limits.expansion * file_bytes):
            raise BadInputError(
                f"{file_bytes} bytes claim to hold {width} x {height} pixels; no photograph packs so tightly: "
                "the file is damaged or a decompression bomb"
            )

    return check_size
