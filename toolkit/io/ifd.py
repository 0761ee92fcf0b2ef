"""TIFF directories, little-endian: what a DNG or TIFF writer puts before its pixels."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

Kind = Literal["byte", "ascii", "short", "long", "rational", "undefined", "srational", "double"]
_CODES: dict[Kind, tuple[int, str]] = {  # TIFF 6.0, section 2: the type's number and how struct packs one item
    "byte": (1, "B"),
    "ascii": (2, "s"),
    "short": (3, "H"),
    "long": (4, "I"),
    "rational": (5, "II"),
    "undefined": (7, "s"),
    "srational": (10, "ii"),
    "double": (12, "d"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entry:
    """One tag's value: its type, how many items, and their bytes."""

    code: int
    count: int
    data: bytes


def numbers(kind: Kind, *values: float) -> Entry:
    """An entry of numbers; "rational" and "srational" turn floats into the simplest fraction near them."""
    code, item = _CODES[kind]
    if kind in ("rational", "srational"):
        parts: Sequence[float] = [part for value in values for part in _fraction(value, signed=kind == "srational")]
    elif kind == "double":
        parts = values
    else:
        parts = [int(value) for value in values]
    return Entry(code=code, count=len(values), data=struct.pack("<" + item * len(values), *parts))


def text(value: str) -> Entry:
    """An entry of ASCII text; what is not ASCII becomes a question mark, and a zero byte ends the text."""
    data = value.split("\0")[0].encode("ascii", "replace") + b"\0"
    return Entry(code=_CODES["ascii"][0], count=len(data), data=data)


def opaque(data: bytes) -> Entry:
    """An entry of bytes that TIFF does not interpret."""
    return Entry(code=_CODES["undefined"][0], count=len(data), data=data)


def _fraction(value: float, *, signed: bool) -> tuple[int, int]:
    """The nearest fraction in 32 bits: 1/60 for a sixtieth, within 5e-10 of what is no short fraction."""
    ceiling = 2**31 - 1 if signed else 2**32 - 1
    finest = max(1, int(ceiling // max(abs(value), 1.0)))
    near = Fraction(float(value)).limit_denominator(finest)
    if abs(near.numerator) > ceiling or (near < 0 and not signed):
        raise ValueError(f"{value} does not fit a TIFF {'signed ' if signed else ''}rational")
    return near.numerator, near.denominator


def size(entries: Mapping[int, Entry]) -> int:
    """Bytes that the directory takes with its values, always even."""
    return 2 + 12 * len(entries) + 4 + sum(_padded(e) for e in entries.values())


def serialise(entries: Mapping[int, Entry], offset: int) -> bytes:
    """The directory as it stands at byte `offset` of the file, its long values behind it, tags ascending."""
    table, values = struct.pack("<H", len(entries)), b""
    behind = offset + 2 + 12 * len(entries) + 4
    for tag in sorted(entries):
        entry = entries[tag]
        inline = len(entry.data) <= 4
        field = entry.data.ljust(4, b"\0") if inline else struct.pack("<I", behind + len(values))
        table += struct.pack("<HHI", tag, entry.code, entry.count) + field
        values += b"" if inline else entry.data.ljust(_padded(entry), b"\0")
    return table + bytes(4) + values


def _padded(entry: Entry) -> int:
    length = len(entry.data)
    return 0 if length <= 4 else length + length % 2
