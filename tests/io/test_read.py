"""Reading photographs through the isolated path."""

from __future__ import annotations

import hashlib
import os

import numpy as np
import pytest

from tests import realdata
from tests.io import good
from toolkit.errors import BadInputError
from toolkit.io import metadata
from toolkit.io.decoded import Limits
from toolkit.io.read import read, read_in_process


def test_a_camera_dng_decodes_to_its_mosaic():
    """The chart's mosaic comes as stored, with black, white, pattern and colour matrix."""
    frame = read(realdata.folder("raw") / "colorchart.dng")
    assert frame.values.shape == (1156, 1734)
    assert frame.cfa is not None
    assert frame.cfa.tolist() == [[0, 1], [1, 2]]
    assert np.all(frame.black == 2056)
    assert np.all(frame.white == 15000)
    assert frame.metadata.xyz_to_camera[0] == pytest.approx((0.6461, -0.1164, -0.0857))


def test_both_paths_agree():
    """The isolated path and the path within this process give the same numbers and the same digest."""
    path = realdata.folder("diligent_ball") / "001.png"
    apart, within = read(path), read_in_process(path)
    assert np.array_equal(apart.values, within.values)
    assert apart.sha256 == within.sha256
    assert apart.encoding == within.encoding == "linear"


@pytest.mark.parametrize(
    ("content", "name", "expected"),
    [
        (None, "gone.dng", "no such file"),
        (b"", "empty.dng", "empty file"),
        (b"once upon a time there was a ball\n" * 20, "text.dng", "a text file named .dng"),
    ],
)
def test_what_is_no_photograph_is_named(tmp_path, content, name, expected):
    """A missing, empty or text file ends in one line that says so."""
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInputError, match=expected) as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_a_folder_is_refused(tmp_path):
    """A folder is no photograph."""
    with pytest.raises(BadInputError, match="a folder"):
        read(tmp_path)


def test_a_pipe_is_refused_without_waiting_for_it(tmp_path):
    """A named pipe that nobody writes to would hang a reader."""
    os.mkfifo(tmp_path / "pipe.dng")
    with pytest.raises(BadInputError, match="not a regular file"):
        read(tmp_path / "pipe.dng")


def test_a_name_with_a_zero_byte_is_no_file():
    """The system has no such names."""
    with pytest.raises(BadInputError, match="no such file"):
        read("a\0b.dng")


def test_a_file_over_the_limit_is_refused_unread(tmp_path):
    """A sparse file of 3 GB: said with both figures."""
    with (tmp_path / "huge.png").open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        file.truncate(3_000_000_000)
    with pytest.raises(BadInputError, match=r"3\.0 GB; at most 2\.1 GB"):
        read(tmp_path / "huge.png")


def test_limits_grow_with_the_file():
    """A bomb is small; a large file may cost more."""
    limits = Limits()
    assert limits.memory_for(1_000_000) < 1e9
    assert limits.memory_for(200_000_000) > 2e9
    assert limits.cpu_for(1_000_000) < 10 < limits.cpu_for(200_000_000)


def test_the_digest_is_of_the_file(tmp_path):
    """SHA-256 of the bytes, in hexadecimal."""
    path = good.png(tmp_path / "a.png")
    assert read(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_metadata_that_do_not_parse_are_left_out_with_a_note(tmp_path, monkeypatch):
    """A parser may raise anything; the pixels come all the same."""

    def fails(path):
        raise RecursionError("tags point at\nthemselves")

    monkeypatch.setitem(metadata._SOURCES["raw"], "EXIF", fails)
    frame = read_in_process(good.dng(tmp_path / "a.dng"))
    assert frame.values.shape == (48, 64)
    assert frame.metadata.make == ""
    assert frame.metadata.noise_profile
    assert frame.metadata.notes == ("EXIF left out: RecursionError: tags point at themselves",)


def test_text_from_a_file_is_one_printable_line(tmp_path):
    """Control characters and endless names do not reach a terminal or a page."""
    told = read_in_process(good.dng(tmp_path / "a.dng", model="\x1b[31mred\nalert " + "x" * 500)).metadata
    assert told.model.isprintable()
    assert len(told.model) <= 300
