"""What the decoders' process is asked for and what it hands back; light, since every decode pays for its imports."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from numpy.typing import NDArray


CheckSize = Callable[[int, int, int], None]  # width, height, bytes a pixel; raises where that is too much


class Limits(NamedTuple):
    """What decoding one file may cost. Memory and time grow with the file, so that only small ones are held short."""

    memory_bytes: int = 900 << 20  # of address space, on top of `memory_per_file_byte` times the file's size
    memory_per_file_byte: float = 6.0
    cpu_s: float = 8.0  # on top of `cpu_s_per_mb` times the file's size
    cpu_s_per_mb: float = 0.1
    wall_s: float = 60.0
    pixels: int = 150_000_000
    file_bytes: int = 2 << 30
    expansion: float = 300.0  # decoded bytes per byte of the file, beyond `expansion_free_bytes`
    expansion_free_bytes: int = 64 << 20

    def memory_for(self, file_bytes: int) -> int:
        """Bytes of address space allowed for a file of this size."""
        return int(self.memory_bytes + self.memory_per_file_byte * file_bytes)

    def cpu_for(self, file_bytes: int) -> int:
        """Whole seconds of processor time allowed for a file of this size."""
        return int(self.cpu_s + self.cpu_s_per_mb * file_bytes / 1e6) + 1


class Decoded(NamedTuple):
    """A decoder's answer: the fields of RawFrame that the pixels and the file's header determine."""

    format: str
    encoding: str  # "linear" or "encoded"
    values: NDArray[Any]  # (H, W) uint16 mosaic, or (H, W, 3) uint8, uint16, float32; oriented
    black: list[Any]
    white: list[Any]
    cfa: list[list[int]] | None = None
    metadata: dict[str, Any] = {}  # noqa: RUF012  # never changed: a default for decoders that find nothing
