"""OpenEXR: three float channels on the display window, as stored."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from toolkit.errors import BadInputError
from toolkit.io import metadata
from toolkit.io.decoded import CheckSize, Decoded

if TYPE_CHECKING:
    import OpenEXR

_TEXTS = {"make": "cameraMake", "model": "cameraModel", "lens": "lensModel", "software": "software", "taken": "capDate"}
_NUMBERS = {"exposure_s": "expTime", "iso": "isoSpeed", "f_number": "aperture", "focal_length_mm": "nominalFocalLength"}
_THREADS = 2
_MOST_SIDE = 65_536  # no frame is wider or higher; OpenEXR refuses the rest before it allocates


def decode(path: str, check_size: CheckSize) -> Decoded:
    """The R, G, B of the first part (H, W, 3) float32, H and W those of the display window.

    Pixels of the display window that the data window does not hold are NaN.
    Raises BadInputError for deep, subsampled, integer and one-channel files; OpenEXR raises RuntimeError on damage.
    """
    import OpenEXR

    if hasattr(OpenEXR, "setMaxImageSize"):  # from 3.5 on; the process's memory limit holds with any version
        OpenEXR.setMaxImageSize(_MOST_SIDE, _MOST_SIDE)
    with OpenEXR.File(path, header_only=True, num_threads=0) as file:
        header = file.parts[0].header
        data, display = _windows(header)
        _check_part(file.parts[0])
        found = _fields(header)
    check_size(*_extent(display), 12)
    check_size(*_extent(data), 12)
    with OpenEXR.File(path, separate_channels=True, num_threads=_THREADS) as file:
        if not file.parts:  # OpenEXR warns on standard error and leaves out the part that it could not read
            raise BadInputError("the EXR's pixels do not decode; the file is damaged: copy or render it again")
        planes = _planes(file.parts[0].channels)
    values = _on_display(planes, data, display)
    return Decoded("exr", "linear", values, black=[0.0] * 3, white=[float("inf")] * 3, metadata=found)


def _fields(header: dict[str, Any]) -> dict[str, Any]:
    """The standard optional attributes that tell of the camera."""
    texts = {name: metadata.plain_text(header[key]) for name, key in _TEXTS.items() if isinstance(header.get(key), str)}
    numbers = {name: header.get(key) for name, key in _NUMBERS.items()}
    return texts | {
        n: float(v) for n, v in numbers.items() if isinstance(v, float | int) and math.isfinite(v) and v > 0
    }


Window = tuple[int, int, int, int]


def _windows(header: dict[str, Any]) -> tuple[Window, Window]:
    """Data and display window as x0, y0, x1, y1, end exclusive."""
    found = []
    for name in ("dataWindow", "displayWindow"):
        low, high = header[name]
        found.append((int(low[0]), int(low[1]), int(high[0]) + 1, int(high[1]) + 1))
    return found[0], found[1]


def _extent(window: Window) -> tuple[int, int]:
    return window[2] - window[0], window[3] - window[1]


def _check_part(part: OpenEXR.Part) -> None:
    import OpenEXR

    if part.header.get("type") in (OpenEXR.deepscanline, OpenEXR.deeptile):
        raise BadInputError("a deep EXR; flat RGB is needed: flatten it first")


def _planes(channels: dict[str, Any]) -> list[NDArray[Any]]:
    """The arrays of R, G, B; the first layer's where the file names no plain ones."""
    names = _rgb_names(list(channels))
    planes = [channels[name].pixels for name in names]
    if any(channels[name].xSampling != 1 or channels[name].ySampling != 1 for name in names):
        raise BadInputError("an EXR with subsampled channels; full-size R, G, B are needed")
    if any(plane is None or plane.ndim != 2 or plane.dtype.kind != "f" for plane in planes):
        raise BadInputError("an EXR whose R, G, B are not all half or float; write them as float")
    if len({plane.shape for plane in planes}) != 1:
        raise BadInputError("an EXR whose R, G, B differ in size; write it again as scan-line RGB")
    return planes


def _rgb_names(names: list[str]) -> list[str]:
    for prefix in ["", *sorted({name.rpartition(".")[0] + "." for name in names if "." in name})]:
        if all(prefix + letter in names for letter in "RGB"):
            return [prefix + letter for letter in "RGB"]
    listed = ", ".join(sorted(names)[:6])
    raise BadInputError(f"an EXR with the channels {listed or 'none'}; R, G and B are needed")


def _on_display(planes: list[NDArray[Any]], data: Window, display: Window) -> NDArray[np.float32]:
    """The planes interleaved on the display window; NaN where there are no data."""
    width, height = _extent(display)
    if data == display:
        return np.stack(planes, axis=-1, dtype=np.float32, casting="same_kind")
    values = np.full((height, width, 3), np.nan, np.float32)
    x0, y0 = max(data[0], display[0]), max(data[1], display[1])
    x1, y1 = min(data[2], display[2]), min(data[3], display[3])
    if x0 >= x1 or y0 >= y1:
        raise BadInputError("an EXR whose data window lies outside its display window; nothing of it is visible")
    target = values[y0 - display[1] : y1 - display[1], x0 - display[0] : x1 - display[0]]
    for channel, plane in enumerate(planes):
        target[..., channel] = plane[y0 - data[1] : y1 - data[1], x0 - data[0] : x1 - data[0]]
    return values
