"""The decoders' own process: limits first, then decode, check, and hand the pixels over. See isolate.py."""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from toolkit.errors import BadInputError
from toolkit.io.decoded import Decoded, Limits

if TYPE_CHECKING:
    from numpy.typing import NDArray

CheckSize = Callable[[int, int, int], None]


def main(request: str) -> None:
    """Decode as the JSON `request` says and write the answer to what was standard output.

    The answer: the pixels, from the first byte on; then JSON, {"error": text} or the fields; its length in 8 bytes.
    """
    asked = json.loads(request)
    limits = Limits(**asked["limits"])
    answer = os.dup(1)
    os.dup2(2, 1)  # whatever a library prints must not land among the pixels
    limit_process(limits, os.path.getsize(asked["path"]))  # noqa: PTH202  # pathlib costs start-up
    values, fields = _answer(asked["kind"], asked["path"], limits)
    _write(answer, values, fields)
    os._exit(0)  # nothing is left to tidy, and libraries' exit handlers cost time or crash


def _answer(kind: str, path: str, limits: Limits) -> tuple[Any, dict[str, Any]]:
    try:
        decoded = decode(kind, path, limits)
    except BadInputError as error:
        return None, {"error": str(error)}
    except MemoryError:
        allowed = limits.memory_for(os.path.getsize(path)) / 1e9  # noqa: PTH202  # as above
        return None, {
            "error": f"decoding needs more than the {allowed:.1f} GB allowed; the file is damaged or too large"
        }
    fields = decoded._asdict()
    values = fields.pop("values")
    return values, {**fields, "shape": values.shape, "dtype": values.dtype.name}


def decode(kind: str, path: str, limits: Limits) -> Decoded:
    """Decode in this very process and check that the result can be a photograph.

    Raises BadInputError.
    """
    from toolkit.io import metadata, plausible

    reading = metadata.start(path)
    decoded = _decoder(kind)(path, size_checker(limits, os.path.getsize(path)))  # noqa: PTH202  # as above
    plausible.check(decoded, os.path.getsize(path))  # noqa: PTH202  # as above
    return decoded._replace(metadata={**decoded.metadata, **reading()})


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


def limit_process(limits: Limits, file_bytes: int) -> None:
    """Bind this process to its memory and processor time, and the libraries to their pixels, before they load."""
    for name, value in {"PIXELS": limits.pixels, "WIDTH": 1 << 17, "HEIGHT": 1 << 17}.items():
        os.environ[f"OPENCV_IO_MAX_IMAGE_{name}"] = str(value)
    try:
        import resource
    except ImportError:  # not on Windows: there the parent's clock and the size check remain
        return
    memory, seconds = limits.memory_for(file_bytes), limits.cpu_for(file_bytes)
    for what, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(what)[1]
        bound = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        resource.setrlimit(what, (bound, bound))


def _write(answer: int, values: NDArray[Any] | None, fields: dict[str, Any]) -> None:
    with os.fdopen(answer, "wb") as file:
        if values is not None:
            file.write(values.data.cast("B"))
        text = json.dumps(fields).encode()
        file.write(text + struct.pack("<Q", len(text)))


if __name__ == "__main__":
    main(sys.argv[1])
