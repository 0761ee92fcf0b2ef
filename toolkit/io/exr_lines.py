"""Writing OpenEXR: float channels on scan lines, not packed, some lines at a time.

The mantissas of measured or computed floats are noise to any packer. The layout is that of "OpenEXR File Layout" in
OpenEXR's technical documentation: one part, a line a chunk. No clock is written.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping
from io import BufferedWriter
from pathlib import Path

import numpy as np

from toolkit.records import Floats

MAGIC, VERSION = 20000630, 2
FLOAT = 2  # the type of a channel's samples
BAND_BYTES = 1 << 20  # of lines that are put together at a time, within the processor's cache


def write_lines(
    path: Path, channels: Mapping[str, Floats], *, corner: tuple[int, int], display: tuple[int, int]
) -> None:
    """Write channels (h, w), stored as float32, 0 where they are no number.

    displayWindow is `display` (width, height); dataWindow lies at `corner` (x, y) in it. Raises OSError where the
    disk does not take it.
    """
    names = sorted(channels)  # the file's own order
    height, width = channels[names[0]].shape
    line = np.dtype([("y", "<i4"), ("bytes", "<i4"), ("channels", "<f4", (len(names), width))])
    header = _header(names, (*corner, corner[0] + width - 1, corner[1] + height - 1), display)
    first = len(header) + 8 * height
    room = np.empty(max(BAND_BYTES // line.itemsize, 1), line)
    with path.open("wb") as file:
        file.write(header + np.arange(first, first + height * line.itemsize, line.itemsize, dtype="<u8").tobytes())
        for start in range(0, height, len(room)):
            band = room[: height - start]
            band["y"] = np.arange(start, start + len(band)) + corner[1]
            band["bytes"] = line["channels"].itemsize
            samples = band["channels"]
            for place, name in enumerate(names):
                samples[:, place] = channels[name][start : start + len(band)]
            np.copyto(samples, 0, where=~np.isfinite(samples))
            file.write(band.data)
            _send_to_disk(file, file.tell() - band.nbytes, band.nbytes)


def _send_to_disk(file: BufferedWriter, start: int, many: int) -> None:
    """Let the disk begin with these bytes: who syncs the file then waits a tenth of the time."""
    if hasattr(os, "posix_fadvise"):  # on Linux this starts writing and waits for nothing
        file.flush()
        os.posix_fadvise(file.fileno(), start, many, os.POSIX_FADV_DONTNEED)


def _header(names: list[str], data: tuple[int, int, int, int], display: tuple[int, int]) -> bytes:
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", FLOAT, 0, 1, 1) for name in names)
    attributes = {
        "channels": ("chlist", listed + b"\0"),
        "compression": ("compression", b"\0"),  # none
        "dataWindow": ("box2i", struct.pack("<4i", *data)),
        "displayWindow": ("box2i", struct.pack("<4i", 0, 0, display[0] - 1, display[1] - 1)),
        "lineOrder": ("lineOrder", b"\0"),  # downwards
        "pixelAspectRatio": ("float", struct.pack("<f", 1.0)),
        "screenWindowCenter": ("v2f", struct.pack("<2f", 0.0, 0.0)),
        "screenWindowWidth": ("float", struct.pack("<f", 1.0)),
    }
    told = [
        f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
        for name, (kind, value) in attributes.items()
    ]
    return struct.pack("<ii", MAGIC, VERSION) + b"".join(told) + b"\0"
