"""TIFF directories: numbers as fractions, and layout."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.io.ifd import numbers, opaque, serialise, size, text


@given(st.floats(min_value=0.0, max_value=4e9))
def test_a_rational_is_as_near_as_32_bits_allow(value: float) -> None:
    """Small numbers to 5e-10, large ones to half a unit of what their numerator leaves."""
    numerator, denominator = struct.unpack("<II", numbers("rational", value).data)
    assert numerator / denominator == pytest.approx(value, abs=5e-10 * max(1.0, value) ** 2)


@pytest.mark.parametrize(
    ("value", "fraction"), [(1 / 60, (1, 60)), (1 / 8000, (1, 8000)), (5.6, (28, 5)), (0.0, (0, 1))]
)
def test_photographic_numbers_stay_the_fractions_they_are(value: float, fraction: tuple[int, int]) -> None:
    """A shutter of a sixtieth is written 1/60."""
    assert struct.unpack("<II", numbers("rational", value).data) == fraction


def test_signed_fractions_keep_their_sign() -> None:
    """A colour matrix has negative numbers."""
    assert struct.unpack("<ii", numbers("srational", -0.1875).data) == (-3, 16)


@pytest.mark.parametrize(("kind", "value"), [("rational", -0.5), ("rational", 5e9), ("srational", -3e9)])
def test_numbers_beyond_32_bits_are_refused(kind: str, value: float) -> None:
    """The error names the number."""
    with pytest.raises(ValueError, match="does not fit"):
        numbers(kind, value)  # type: ignore[arg-type]  # a parameter


def test_text_is_ascii_ended_by_a_zero() -> None:
    """What is not ASCII becomes a question mark; nothing hides behind an inner zero."""
    assert text("Zürich\0hidden").data == b"Z?rich\0"


def test_a_directory_lists_its_tags_in_order_and_puts_long_values_behind() -> None:
    """Four bytes stand in the table itself; more stand behind it, on even offsets."""
    entries = {700: opaque(b"12345"), 256: numbers("short", 7), 300: numbers("double", 0.5)}
    raw = serialise(entries, 8)
    assert len(raw) == size(entries)
    rows = [struct.unpack_from("<HHII", raw, 2 + 12 * i) for i in range(3)]
    assert [row[0] for row in rows] == [256, 300, 700]
    assert rows[0][3] == 7
    assert struct.unpack_from("<d", raw, rows[1][3] - 8) == (0.5,)
    assert raw[rows[2][3] - 8 :][:5] == b"12345"
    assert all(row[3] % 2 == 0 for row in rows[1:])
