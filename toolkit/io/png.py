"""What a PNG says before its pixels (W3C PNG, third edition): size, depth, and whether a transfer curve is named."""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

from toolkit.errors import BadInputError
from toolkit.io import icc

_LONGEST_PROFILE = 1 << 20
SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Header(NamedTuple):
    """Size and depth of a PNG, and whether the file itself says that it is not linear."""

    width: int
    height: int
    bits: int
    transfer_named: bool


def read_header(path: str) -> Header:
    """The header; every chunk's checksum is verified, so that a damaged or truncated file is refused.

    Raises BadInputError with the place of the damage.
    """
    with open(path, "rb") as file:  # noqa: PTH123  # pathlib costs the child's start-up
        data = file.read()
    if data[:8] != SIGNATURE:
        raise BadInputError("a PNG without its signature; the file is damaged: copy or export it again")
    header: Header | None = None
    curve = False
    for kind, body in _chunks(data):
        if kind == b"IHDR" and len(body) == 13:
            width, height, bits = struct.unpack(">IIB", body[:9])
            header = Header(width, height, bits, False)
        curve = curve or _names_a_curve(kind, body)
    if header is None:
        raise BadInputError("a PNG without its header; the file is damaged: copy or export it again")
    return header._replace(transfer_named=curve)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    """(type, body) of every chunk up to IEND; bodies of image data are left empty."""
    found, at, view = [], 8, memoryview(data)
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 12 + length
        if end > len(data):
            break
        if zlib.crc32(view[at + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise BadInputError(f"a PNG damaged at byte {at} (a checksum is wrong); copy or export it again")
        found.append((kind, b"" if kind == b"IDAT" else bytes(view[at + 8 : end - 4])))
        if kind == b"IEND":
            return found
        at = end
    raise BadInputError(f"a PNG that ends early, at byte {len(data)}; copy or export it again")


def _names_a_curve(kind: bytes, body: bytes) -> bool:
    """Whether a chunk says that the samples are encoded; a gamma of 1 (100000) says that they are linear."""
    if kind == b"gAMA" and len(body) == 4:
        return bool(struct.unpack(">I", body)[0] != 100_000)
    if kind == b"cICP" and len(body) == 4:
        return body[1] != 8  # ITU-T H.273: transfer characteristics 8 are linear
    if kind == b"iCCP":
        return not icc.is_linear(_profile(body))
    return kind == b"sRGB"


def _profile(body: bytes) -> bytes:
    """The profile in an iCCP chunk (name, zero, method, deflated data); empty where it does not inflate."""
    packed = body.partition(b"\0")[2][1:]
    try:
        return zlib.decompressobj().decompress(packed, _LONGEST_PROFILE)
    except zlib.error:
        return b""
