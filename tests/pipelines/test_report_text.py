"""Names and numbers made fit to print."""

from __future__ import annotations

import math
from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipelines.report.numbers import digits, measured, percent
from pipelines.report.text import MAX_CHARACTERS, base_name, clean, stem


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("ball.dng", "ball"),
        ("ball.v2.tiff", "ball.v2"),
        ("/a/b/ball 1 (raw).dng", "ball 1 (raw)"),
        ("../../etc/passwd", "passwd"),
        ("c:\\users\\me\\ball.exr", "ball"),
        ("übung.png", "übung"),
        ("CON.dng", "_CON"),
        ("..", "_"),
        ("", "_"),
        (".hidden", "hidden"),
        ("-rf.dng", "rf"),
        ("=cmd().dng", "_cmd()"),
    ],
)
def test_a_stem_is_the_files_name_without_what_could_hurt(name: str, expected: str) -> None:
    """Plain names keep their looks; paths, devices, options and dots lose theirs."""
    assert stem(name) == expected


@given(st.text())
def test_no_stem_leaves_its_folder(name: str) -> None:
    """Whatever the name, folder and file are two path components on every system, and the file can be made."""
    made = stem(name)
    assert made
    assert len(made) <= 101
    assert PurePosixPath("out", made).parts == ("out", made)
    assert PureWindowsPath("out", made).parts == ("out", made)
    assert not made.startswith((".", "-", "~"))
    made.encode("utf-8")


@given(st.text(st.characters()))
def test_clean_text_is_one_printable_line(text: str) -> None:
    """No control, direction or surrogate character is left, and no more than 400 characters."""
    cleaned = clean(text)
    assert len(cleaned) <= MAX_CHARACTERS
    assert "\n" not in cleaned
    assert "\u202e" not in cleaned
    assert "\x1b" not in cleaned
    cleaned.encode("utf-8")


def test_a_base_name_is_the_last_part_of_any_path() -> None:
    """Both kinds of slash part."""
    assert base_name("/a/b.dng") == "b.dng"
    assert base_name("c:\\a\\b.dng") == "b.dng"


@pytest.mark.parametrize(
    ("value", "sd", "expected"),
    [
        (0.12, 0.00012, "0.12000"),
        (0.123456, 0.0034, "0.1235"),
        (1234.5, 12.0, "1234"),
        (1234.5, 120.0, "1230"),
        (-0.5, 0.1, "−0.50"),
        (2.1e-6, 9.2e-5, "0.000002"),
        (2.17e-8, 3.4e-9, "2.17e-08"),
        (0.0, 0.01, "0.000"),
        (3.14159, None, "3.142"),
        (None, 0.1, "–"),
        (math.nan, 0.1, "–"),
        (0.5, math.inf, "0.5000"),
    ],
)
def test_a_value_is_written_to_two_digits_of_its_sd(value: float | None, sd: float | None, expected: str) -> None:
    """As many digits as the uncertainty allows, four where none is known."""
    assert measured(value, sd) == expected


def test_digits_and_percentages() -> None:
    """Significant digits without an exponent where it reads well without."""
    assert digits(0.00012345, 2) == "0.00012"
    assert digits(123456.0, 3) == "123456"
    assert digits(1.5e-9, 2) == "1.5e-09"
    assert digits(0.0) == "0"
    assert percent(0.041) == "4.1 %"
    assert percent(None) == "–"
