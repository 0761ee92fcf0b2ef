"""A camera's channels to sRGB by its file's matrices, against colour-science and against simulated cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import realdata
from toolkit.io.read import read_in_process
from toolkit.radiometry.chart import colour_science
from toolkit.radiometry.colour import BRADFORD, D50, D65, ILLUMINANTS, XYZ_TO_SRGB, adaptation, camera_colour, to_xyz
from toolkit.radiometry.colour import temperature as cct
from toolkit.records import Metadata

colour = colour_science()
COLOUR_A = ((0.80, -0.25, 0.02), (-0.40, 1.25, 0.18), (-0.06, 0.20, 0.62))
COLOUR_D65 = ((0.69, -0.19, -0.06), (-0.45, 1.24, 0.23), (-0.08, 0.21, 0.56))
DUAL = Metadata(xyz_to_camera=COLOUR_A, xyz_to_camera_2=COLOUR_D65, calibration_illuminants=(17, 21))
OBSERVER = "CIE 1931 2 Degree Standard Observer"


def rows(matrix: np.ndarray) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(a), float(b), float(c)) for a, b, c in matrix)


def response(matrix: object, xy: tuple[float, float]) -> np.ndarray:
    """A camera's colour of a light of this chromaticity."""
    return np.asarray(matrix) @ colour.xy_to_XYZ(np.array(xy))


def test_the_constants_are_the_standards() -> None:
    """The matrix of sRGB, the whites and Bradford's adaptation are those of colour-science."""
    np.testing.assert_allclose(XYZ_TO_SRGB, colour.models.RGB_COLOURSPACE_sRGB.matrix_XYZ_to_RGB, atol=5e-4)
    whites = colour.CCS_ILLUMINANTS[OBSERVER]
    names = {17: "A", 18: "B", 19: "C", 20: "D55", 21: "D65", 22: "D75", 23: "D50"}
    for code, name in names.items():
        np.testing.assert_allclose(ILLUMINANTS[code][1:], whites[name], atol=4e-5)
    np.testing.assert_allclose(D65, colour.xy_to_XYZ(whites["D65"]), atol=3e-4)
    np.testing.assert_allclose(D50, colour.xy_to_XYZ(whites["D50"]), atol=3e-4)
    theirs = colour.adaptation.matrix_chromatic_adaptation_VonKries(D50, D65, transform="Bradford")
    np.testing.assert_allclose(adaptation(D50, D65), theirs, atol=1e-12)
    np.testing.assert_allclose(BRADFORD, colour.adaptation.CHROMATIC_ADAPTATION_TRANSFORMS["Bradford"])


def test_white_stays_white_and_srgb_cameras_change_nothing() -> None:
    """(1, 1, 1) to (1, 1, 1) for every kind of tag; a camera whose channels are sRGB's own gives the unit matrix."""
    for metadata in (DUAL, Metadata(xyz_to_camera=COLOUR_A, calibration_illuminants=(17,)), forward()):
        for light in (None, response(COLOUR_D65, (0.3127, 0.329)), response(COLOUR_A, (0.4476, 0.4074))):
            found = camera_colour(metadata, light=light)
            assert found is not None
            np.testing.assert_allclose(found.to_srgb @ np.ones(3), np.ones(3), atol=1e-4)
            np.testing.assert_allclose(to_xyz(found) @ np.ones(3), D65, atol=1e-4)
    own = camera_colour(Metadata(xyz_to_camera=rows(XYZ_TO_SRGB)))
    assert own is not None
    np.testing.assert_allclose(own.to_srgb, np.eye(3), atol=2e-4)


def forward() -> Metadata:
    """The dual camera with forward matrices, as the specification derives them: balanced camera to XYZ under D50."""
    made = []
    for matrix, code in ((COLOUR_A, 17), (COLOUR_D65, 21)):
        white = colour.xy_to_XYZ(np.array(ILLUMINANTS[code][1:]))
        to_d50 = colour.adaptation.matrix_chromatic_adaptation_VonKries(white, D50, transform="Bradford")
        made.append(rows(to_d50 @ np.linalg.inv(matrix) @ np.diag(np.asarray(matrix) @ white)))
    return replace(DUAL, forward_matrix=made[0], forward_matrix_2=made[1])


def test_forward_and_colour_matrices_that_say_the_same_give_the_same() -> None:
    """One camera described both ways: equal to Bradford's detour over D50."""
    for light in (None, response(COLOUR_A, (0.4476, 0.4074)), response(COLOUR_D65, (0.3457, 0.3585))):
        one, other = camera_colour(DUAL, light=light), camera_colour(forward(), light=light)
        assert one is not None
        assert other is not None
        assert (one.source, other.source) == ("colour-matrix", "forward-matrix")
        np.testing.assert_allclose(one.to_srgb, other.to_srgb, atol=2e-4)


def test_the_light_chooses_between_two_calibrations() -> None:
    """Tungsten takes the first, daylight the second, D50 a mixture by reciprocal temperature; none said: daylight."""
    first = camera_colour(replace(DUAL, xyz_to_camera_2=()))
    second = camera_colour(Metadata(xyz_to_camera=COLOUR_D65))
    assert first is not None
    assert second is not None
    tungsten = camera_colour(DUAL, light=response(COLOUR_A, (0.44757, 0.40745)))
    daylight = camera_colour(DUAL, light=response(COLOUR_D65, (0.3127, 0.3290)))
    unsaid, nonsense = camera_colour(DUAL), camera_colour(DUAL, light=np.array([0.01, 1.0, 0.01]))
    for found, expected in ((tungsten, first), (daylight, second), (unsaid, second), (nonsense, second)):
        assert found is not None
        np.testing.assert_allclose(found.to_srgb, expected.to_srgb, atol=5e-3)
    assert np.abs(first.to_srgb - second.to_srgb).max() > 0.05
    share = (1 / 5003 - 1 / 2856) / (1 / 6504 - 1 / 2856)
    mixed = (1 - share) * np.array(COLOUR_A) + share * np.array(COLOUR_D65)
    half = camera_colour(DUAL, light=response(mixed, (0.34567, 0.35850)))
    assert half is not None
    np.testing.assert_allclose(half.to_srgb, (1 - share) * first.to_srgb + share * second.to_srgb, atol=5e-3)


@pytest.mark.parametrize("kelvin", [2856, 4000, 5000, 6504, 8000])
def test_temperatures_are_those_of_colour_science(kelvin: int) -> None:
    """Within 1 % along the Planckian locus; what is no light has none."""
    xy = colour.temperature.CCT_to_xy_Kang2002(kelvin)
    assert cct(colour.xy_to_XYZ(xy)) == pytest.approx(kelvin, rel=0.01)
    assert cct(np.array([-0.1, 1.0, 1.0])) is None
    assert cct(np.array([0.1, 1.0, 0.1])) is None


@pytest.mark.parametrize(
    "matrix",
    [(), ((1.0, 0.0, 0.0),) * 3, ((np.nan,) * 3,) * 3, ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))],
)
def test_a_matrix_that_is_no_cameras_is_not_used(matrix: tuple[tuple[float, float, float], ...]) -> None:
    """Missing, singular, not finite, or seeing white as negative."""
    assert camera_colour(Metadata(xyz_to_camera=matrix)) is None


def test_a_spectral_camera_comes_out_right() -> None:
    """Spectra of the chart through Gaussian sensors under tungsten: within 6 CIEDE2000 of the truth under D65.

    The camera's matrices are fitted as a maker would, to other spectra. Without the white balance nothing fits.
    """
    shape = colour.SpectralShape(400, 700, 10)
    waves = shape.range()
    sensors = np.exp(-(((waves[:, None] - [600.0, 540.0, 460.0]) / [40.0, 42.0, 32.0]) ** 2) / 2)
    observer = colour.MSDS_CMFS[OBSERVER].copy().align(shape).values
    chart = np.array(
        [sd.copy().align(shape).values for sd in colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()]
    )
    lights = {name: colour.SDS_ILLUMINANTS[name].copy().align(shape).values for name in ("A", "D65")}
    smooth = np.exp(-(((waves - np.linspace(400, 700, 25)[:, None]) / 45.0) ** 2) / 2)
    matrices = {}
    for name, light in lights.items():
        trained_xyz, trained_rgb = smooth * light @ observer, smooth * light @ sensors
        matrices[name] = np.linalg.lstsq(trained_xyz, trained_rgb, rcond=None)[0].T
    metadata = Metadata(
        xyz_to_camera=rows(matrices["A"]), xyz_to_camera_2=rows(matrices["D65"]), calibration_illuminants=(17, 21)
    )
    light = lights["A"] @ sensors
    found = camera_colour(metadata, light=light)
    assert found is not None
    truth = chart * lights["D65"] @ observer / (lights["D65"] @ observer)[1]
    d65 = D65[:2] / D65.sum()

    def missed(reflectances: np.ndarray) -> float:
        pair = [colour.XYZ_to_Lab(np.maximum(xyz, 0), d65) for xyz in (reflectances @ to_xyz(found).T, truth)]
        return float(np.mean(colour.delta_E(pair[0], pair[1], method="CIE 2000")))

    seen = chart * lights["A"] @ sensors
    assert missed(seen / light) < 6.0
    assert missed(seen / light.max()) > 15.0


def test_real_files_carry_what_is_needed() -> None:
    """Blackmagic.dng: two calibrations with forward matrices; colorchart.dng: one colour matrix, no illuminant."""
    blackmagic = read_in_process(realdata.folder("raw") / "Blackmagic.dng").metadata
    assert blackmagic.calibration_illuminants == (17, 21)
    found = camera_colour(blackmagic, light=np.array(blackmagic.as_shot_neutral))
    by_colour = camera_colour(replace(blackmagic, forward_matrix=(), forward_matrix_2=()))
    assert found is not None
    assert by_colour is not None
    assert found.source == "forward-matrix"
    by_forward = camera_colour(blackmagic)
    assert by_forward is not None
    np.testing.assert_allclose(by_forward.to_srgb, by_colour.to_srgb, atol=0.1)  # two fits of one camera by its maker
    chart = camera_colour(read_in_process(realdata.folder("raw") / "colorchart.dng").metadata)
    assert chart is not None
    assert chart.source == "colour-matrix"
