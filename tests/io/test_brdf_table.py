"""Cornell's tables of measured reflectance: read as published, refused in one line where they are something else."""

from __future__ import annotations

import numpy as np
import pytest

from tests.realdata import folder
from toolkit.errors import BadInputError
from toolkit.io.brdf_table import read_brdf_table

GOOD = """# Cornell University
2
400
700
# theta i, phi i, theta s, phi_s, values
0.5 0.0 0.5 3.141592653589793 1.5 2.5
0.2 0.0 1.0 0.0 0.25 0.5
"""


def _written(tmp_path, text):
    path = tmp_path / "some.brdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_a_small_table(tmp_path):
    """Directions in the surface's frame, the mirror direction at an azimuth of pi, values as they stand."""
    table = read_brdf_table(_written(tmp_path, GOOD))
    np.testing.assert_allclose(table.view[0], table.light[0] * [-1, -1, 1], atol=1e-15)
    np.testing.assert_array_equal(table.brdf, [[1.5, 2.5], [0.25, 0.5]])
    np.testing.assert_array_equal(table.wavelength_nm, [400, 700])
    np.testing.assert_array_equal(table.bands((300.0, 500.0, 800.0)), table.brdf)
    with pytest.raises(BadInputError, match="no wavelength in one of the bands"):
        table.bands()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"\x89PNG\r\n\x1a\n\x00\xff", "text that is no number"),
        ("", "no count of wavelengths"),
        ("2.5\n400 700\n", "no count of wavelengths"),
        ("-3\n", "no count of wavelengths"),
        ("99999999\n400\n", "no count of wavelengths"),
        ("3\n400 500 600 700\n", "expected 3"),
        ("2\n400 700\n", "no measurements"),
        ("2\n400 700\n0.5 0 0.5 0 1\n", "a line of 5 numbers"),
        ("2\n400 700\n0.5 0 0.5 0 1 nan\n", "not finite"),
        ("2\n400 700\n2.5 0 0.5 0 1 1\n", "polar angles"),
        ("2\n700 400\n0.5 0 0.5 0 1 1\n", "do not increase"),
        ("2\n400 700\n0.5 0 0.5 0 one 1\n", "text that is no number"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, text, says):
    """One line: what was found, what was expected."""
    with pytest.raises(BadInputError, match=says) as refused:
        read_brdf_table(_written(tmp_path, text))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["acryl_blue", "cayman", "krylon_blue"])
def test_the_published_tables(name):
    """1439 directions at 31 wavelengths, brightest in the mirror direction."""
    table = read_brdf_table(folder("measured_brdf") / f"{name}.brdf")
    assert table.brdf.shape == (1439, 31)
    assert (table.wavelength_nm[0], table.wavelength_nm[-1]) == (400.0, 700.0)
    brightest = np.argmax(table.brdf.mean(axis=1))
    np.testing.assert_allclose(table.view[brightest], table.light[brightest] * [-1, -1, 1], atol=0.05)
