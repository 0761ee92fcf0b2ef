"""An OpenEXR file of float32 scan lines, not packed: any lines at any time, made where they are written from.

OpenEXR's own writer takes whole planes and copies them sample by sample. Here no plane is held, several processes can
write lines of one file, and the disk takes the first while the next are made. The bytes are the same, by "OpenEXR File
Layout" of openexr.com.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.records import Floats

from .folder import begin_sync

Window = tuple[int, int, int, int]  # x, y of the first pixel and of the last
Fill = Callable[[slice, Floats], None]

MAGIC, VERSION, FLOAT, NO_COMPRESSION, INCREASING_Y = 20000630, 2, 2, b"\0", b"\0"
AT_A_TIME = 1 << 21  # bytes of lines: less costs calls, more leaves the processor's cache
SENT = 1 << 23  # bytes that the disk is asked to take at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Scanlines:
    """The file; `channels` in the order of their names, `data` the window that the lines fill, `display` the image's.

    Both methods raise OSError where the disk does not take it.
    """

    path: Path
    channels: tuple[str, ...]
    data: Window
    display: Window

    def begin(self) -> None:
        """Write what stands before the lines; the file is as long as it will be."""
        height, size = self.data[3] - self.data[1] + 1, 8 + self._line_bytes
        begin = self._begin
        with self.path.open("wb") as file:
            file.write(_header(self.channels, self.data, self.display))
            file.write(np.arange(begin, begin + height * size, size, dtype="<i8").data)
            file.truncate(begin + height * size)

    def write(self, rows: slice, fill: Fill) -> None:
        """Write some of the lines; `fill(rows, lines)` puts a few of them into `lines` (n, channels, w)."""
        size, width = self._line_bytes, self.data[2] - self.data[0] + 1
        together = max(AT_A_TIME // size, 1)
        whole = np.empty((together, 2 + len(self.channels) * width), "<f4")  # a line's y and size before its samples
        numbers, lines = whole[:, :2].view("<i4"), whole[:, 2:].reshape(together, len(self.channels), width)
        numbers[:, 1] = size
        with self.path.open("r+b") as file:
            sent = file.seek(self._begin + rows.start * (8 + size))
            for start in range(rows.start, rows.stop, together):
                count = min(together, rows.stop - start)
                fill(slice(start, start + count), lines[:count])
                numbers[:, 0] = self.data[1] + start + np.arange(together)
                file.write(whole[:count].data)
                if (done := file.tell()) - sent >= SENT or start + count == rows.stop:
                    file.flush()
                    begin_sync(file.fileno(), sent, done - sent)
                    sent = done

    @property
    def _line_bytes(self) -> int:
        return 4 * len(self.channels) * (self.data[2] - self.data[0] + 1)

    @property
    def _begin(self) -> int:
        """Where the first line stands."""
        return len(_header(self.channels, self.data, self.display)) + 8 * (self.data[3] - self.data[1] + 1)


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
