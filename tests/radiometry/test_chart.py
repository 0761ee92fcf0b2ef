"""A colour chart in a photograph: found, read, and turned into the camera's matrix."""

from __future__ import annotations

import numpy as np
import pytest

from tests import realdata
from toolkit.errors import BadInputError
from toolkit.io.read import read_in_process
from toolkit.radiometry.chart import (
    Chart,
    colour_of_chart,
    colour_science,
    find_chart,
    leave_one_out,
    reference_xyz,
)
from toolkit.radiometry.colour import D65, XYZ_TO_SRGB, camera_colour, to_xyz
from toolkit.radiometry.linearise import linearise
from toolkit.radiometry.quads import Quads, quads

colour = colour_science()
CAMERA = np.array([[0.62, 0.31, 0.05], [0.22, 0.70, 0.12], [0.04, 0.18, 0.66]])  # linear sRGB to camera, rows sum not 1
LIGHT = np.array([0.9, 1.6, 1.1])


def painted(size: int = 900) -> np.ndarray:
    """A chart on grey, slightly turned, through a camera of known matrix under a coloured light."""
    import cv2

    srgb = np.clip(reference_xyz() @ XYZ_TO_SRGB.T, 0.0, None)
    flat = np.full((440, 640, 3), 0.03)
    for k, patch in enumerate(srgb):
        row, column = divmod(k, 6)
        flat[20 + 102 * row : 112 + 102 * row, 20 + 102 * column : 112 + 102 * column] = patch
    turn = cv2.getRotationMatrix2D((320, 220), 7, 0.95)
    turn[:, 2] += (130, 230)
    scene = cv2.warpAffine(flat, turn, (size, size), borderMode=cv2.BORDER_CONSTANT, borderValue=(0.25, 0.25, 0.25))
    return np.asarray(scene @ (CAMERA / CAMERA.sum(axis=1, keepdims=True)).T * LIGHT * 0.3, np.float32)


def test_a_known_camera_is_found_back() -> None:
    """Matrix and light of a painted chart, both to a few thousandths; the patches' errors nearly nothing."""
    picture = painted()
    found = colour_of_chart(find_chart(picture, np.ones(picture.shape[:2], bool)))
    expected = np.linalg.inv(CAMERA / CAMERA.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(found.to_srgb, expected, atol=0.02)
    assert found.white is not None
    np.testing.assert_allclose(found.white, 0.3 * LIGHT, rtol=0.01)
    assert found.delta_e is not None
    assert found.delta_e < 1.0  # cyan lies outside sRGB and was painted at its edge


@pytest.fixture(scope="module")
def photograph() -> Quads:
    return quads(linearise(read_in_process(realdata.folder("raw") / "colorchart.dng")))


def test_a_real_chart_comes_out_within_its_figure(photograph: Quads) -> None:
    """colorchart.dng, each patch by the matrix of the 23 others: mean CIEDE2000 at most 3.3."""
    chart = find_chart(photograph.values, photograph.flags == 0)
    errors = leave_one_out(chart.patches, reference_xyz())
    assert errors.mean() <= 3.3
    found = colour_of_chart(chart)
    assert found.delta_e == pytest.approx(errors.mean())
    np.testing.assert_allclose(found.to_srgb @ np.ones(3), np.ones(3), atol=1e-4)
    assert found.white is not None
    assert found.white.argmax() == 1  # the camera's green sees most


def test_the_cameras_own_matrix_agrees_with_the_chart(photograph: Quads) -> None:
    """The file's matrix on the same patches, balanced by their greys: within 6 CIEDE2000; unbalanced, far off."""
    metadata = read_in_process(realdata.folder("raw") / "colorchart.dng").metadata
    chart = find_chart(photograph.values, photograph.flags == 0)
    light = colour_of_chart(chart).white
    assert light is not None
    by_file = camera_colour(metadata, light=light)
    assert by_file is not None
    d65, reference = D65[:2] / D65.sum(), reference_xyz()

    def missed(reflectances: np.ndarray) -> float:
        pair = [colour.XYZ_to_Lab(np.maximum(xyz, 0), d65) for xyz in (reflectances @ to_xyz(by_file).T, reference)]
        return float(np.mean(colour.delta_E(pair[0], pair[1], method="CIE 2000")))

    assert missed(chart.patches / light) < 6.0
    assert missed(chart.patches / light.max()) > 15.0


def test_what_is_no_chart_is_refused_in_a_line(photograph: Quads) -> None:
    """Nothing in view; patches of no chart's colours; a clipped patch."""
    empty = np.random.default_rng(1).uniform(0.1, 0.2, (300, 400, 3)).astype(np.float32)
    with pytest.raises(BadInputError, match="no 24-patch colour chart found"):
        find_chart(empty, np.ones((300, 400), bool))
    chart = find_chart(photograph.values, photograph.flags == 0)
    shuffled = Chart(patches=chart.patches[::-1].copy(), corners=chart.corners.copy())
    with pytest.raises(BadInputError, match="miss their colours"):
        colour_of_chart(shuffled)
    x, y = chart.corners[18].mean(axis=0).astype(int)
    usable = np.ones(photograph.flags.shape, bool)
    usable[y - 4 : y + 5, x - 4 : x + 5] = False
    with pytest.raises(BadInputError, match="clipped"):
        find_chart(photograph.values, usable)


def test_colour_science_leaves_numpy_printing_as_it_was() -> None:
    """Importing it alone would bring back the spaces of numpy 1.13."""
    assert colour_science() is colour
    assert repr(np.array([1.0])) == "array([1.])"
