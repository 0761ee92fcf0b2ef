"""An OpenEXR file of float32 scan lines, not packed: a few lines at a time, made where they are written from.

OpenEXR's own writer takes whole planes and copies them sample by sample. Here no plane is held, and the disk takes the
first lines while the next are made. The bytes are the same, by "OpenEXR File Layout" of openexr.com.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from toolkit.records import Floats

from .folder import begin_sync

Window = tuple[int, int, int, int]  # x, y of the first pixel and of the last
Fill = Callable[[slice, Floats], None]

MAGIC, VERSION, FLOAT, NO_COMPRESSION, INCREASING_Y = 20000630, 2, 2, b"\0", b"\0"
AT_A_TIME = 1 << 21  # bytes of lines: less costs calls, more leaves the processor's cache
SENT = 1 << 23  # bytes that the disk is asked to take at once


def write_lines(path: Path, channels: Sequence[str], fill: Fill, *, data: Window, display: Window) -> None:
    """Write channels, told in the order of their names; `fill(rows, lines)` puts them into `lines` (n, channels, w).

    `data` is the window that the lines fill, `display` that of the whole image. Raises OSError where the disk does not
    take it.
    """
    width, height = data[2] - data[0] + 1, data[3] - data[1] + 1
    header, size = _header(channels, data, display), 4 * len(channels) * width
    together = max(AT_A_TIME // size, 1)
    whole = np.empty((together, 2 + len(channels) * width), "<f4")  # a line's y and size stand before its samples
    numbers, lines = whole[:, :2].view("<i4"), whole[:, 2:].reshape(together, len(channels), width)
    numbers[:, 1] = size
    begin = len(header) + 8 * height
    sent = 0
    with path.open("wb") as file:
        file.write(header)
        file.write(np.arange(begin, begin + height * (8 + size), 8 + size, dtype="<i8").data)
        for start in range(0, height, together):
            count = min(together, height - start)
            fill(slice(start, start + count), lines[:count])
            numbers[:, 0] = data[1] + start + np.arange(together)
            file.write(whole[:count].data)
            if (done := file.tell()) - sent >= SENT:
                begin_sync(file.fileno(), sent, done - sent)
                sent = done


def _header(channels: Sequence[str], data: Window, display: Window) -> bytes:
    each = b"".join(_text(name) + struct.pack("<iB3xii", FLOAT, 0, 1, 1) for name in channels)
    attributes = (
        ("channels", "chlist", each + b"\0"),
        ("compression", "compression", NO_COMPRESSION),
        ("dataWindow", "box2i", struct.pack("<4i", *data)),
        ("displayWindow", "box2i", struct.pack("<4i", *display)),
        ("lineOrder", "lineOrder", INCREASING_Y),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        ("type", "string", b"scanlineimage"),
    )
    told = (_text(name) + _text(kind) + struct.pack("<i", len(value)) + value for name, kind, value in attributes)
    return struct.pack("<ii", MAGIC, VERSION) + b"".join(told) + b"\0"


def _text(name: str) -> bytes:
    return name.encode("ascii") + b"\0"
