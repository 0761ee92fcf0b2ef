"""Whether an ICC profile's curves are straight (ICC.1:2022, sections 10.6 and 10.18): the file's numbers are linear."""

from __future__ import annotations

import struct

_CURVES = (b"rTRC", b"gTRC", b"bTRC")


def is_linear(profile: bytes) -> bool:
    """True only where the profile gives all three tone curves and each has an exponent of one; False in any doubt."""
    try:
        (count,) = struct.unpack_from(">I", profile, 128)
        tags = [struct.unpack_from(">4sII", profile, 132 + 12 * i) for i in range(min(count, 100))]
    except struct.error:
        return False
    curves = {name: profile[offset : offset + size] for name, offset, size in tags if name in _CURVES}
    return len(curves) == len(_CURVES) and all(_is_straight(curve) for curve in curves.values())


def _is_straight(curve: bytes) -> bool:
    if curve[:4] == b"curv" and len(curve) >= 12:
        (count,) = struct.unpack_from(">I", curve, 8)
        return count == 0 or (count == 1 and curve[12:14] == b"\x01\x00")  # no entry: identity; one: gamma as u8.8
    if curve[:4] == b"para" and len(curve) >= 16:
        kind, _, gamma = struct.unpack_from(">HHi", curve, 8)
        return bool(kind == 0 and gamma == 1 << 16)  # s15.16
    return False
