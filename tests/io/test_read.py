"""Reading photographs through the isolated path."""

from __future__ import annotations

import numpy as np
import pytest

from tests import realdata
from toolkit.errors import BadInputError
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
