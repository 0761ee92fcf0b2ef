"""The DNG writer against four readers that are not ours."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from toolkit.io.dng import write_dng

MATRIX = [[0.9, -0.3, -0.1], [-0.4, 1.2, 0.2], [-0.1, 0.2, 0.6]]
NEUTRAL = (0.5, 1.0, 0.625)
BLACK = (512, 513.5, 511, 514)
PROFILE = [[2.5e-5, 5.6e-9], [2.1e-5, 4.2e-9], [3.3e-5, 7.7e-9]]
CHANNELS = {"RGGB": (0, 1, 1, 2), "BGGR": (2, 1, 1, 0), "GRBG": (1, 0, 2, 1), "GBRG": (1, 2, 0, 1)}


def mosaic(height: int = 62, width: int = 94, seed: int = 1) -> np.ndarray:
    values = np.random.default_rng(seed).integers(0, 65536, (height, width), dtype=np.uint16)
    values[0, :4] = 0, 1, 65534, 65535
    return values


def write(path: Path, values: np.ndarray, **changed: object) -> None:
    tags: dict = {
        "cfa": "RGGB",
        "black": BLACK,
        "white": 65000,
        "noise_profile": PROFILE,
        "xyz_to_camera": MATRIX,
        "as_shot_neutral": NEUTRAL,
        "exposure_s": 1 / 60,
        "iso": 200,
        "f_number": 5.6,
        "focal_length_mm": 85.0,
        "lens": "85mm f/1.8",
    }
    write_dng(path, values, **(tags | changed))


@pytest.mark.parametrize("cfa", CHANNELS)
def test_rawpy_reads_every_sample_and_its_colour(tmp_path: Path, cfa: str) -> None:
    """LibRaw sees the mosaic bit for bit, each sample in its own channel."""
    import rawpy

    values = mosaic()
    write(tmp_path / "a.dng", values, cfa=cfa)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, values)
        colours = np.where(raw.raw_colors_visible == 3, 1, raw.raw_colors_visible)
        np.testing.assert_array_equal(colours[:2, :2].ravel(), CHANNELS[cfa])
        assert raw.white_level == 65000
        assert raw.sizes.flip == 0


def test_rawpy_reads_the_black_level_of_each_position(tmp_path: Path) -> None:
    """Four whole black levels come back each with its own 2 x 2 position."""
    import rawpy

    write(tmp_path / "a.dng", mosaic(), black=(500, 510, 520, 530))
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        black = np.array(raw.black_level_per_channel)[raw.raw_colors_visible[:2, :2]]
    np.testing.assert_array_equal(black, [[500, 510], [520, 530]])


@pytest.mark.parametrize(("orientation", "flip"), [(1, 0), (3, 3), (6, 6), (8, 5)])
def test_rawpy_reads_the_orientation(tmp_path: Path, orientation: int, flip: int) -> None:
    """EXIF's turned frames arrive as LibRaw's flips."""
    import rawpy

    write(tmp_path / "a.dng", mosaic(), orientation=orientation)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        assert raw.sizes.flip == flip


def test_tifffile_reads_pixels_and_every_dng_tag(tmp_path: Path) -> None:
    """The tags hold the numbers that were given, rationals to 1e-6 and the noise profile exactly."""
    import tifffile

    values = mosaic()
    write(tmp_path / "a.dng", values, crop=(4, 2, 80, 56))
    with tifffile.TiffFile(tmp_path / "a.dng") as file:
        page = file.pages[0]
        np.testing.assert_array_equal(page.asarray(), values)
        tags = {tag.code: tag.value for tag in page.tags}
    ratio = lambda code: np.array(tags[code], float).reshape(-1, 2)  # noqa: E731  # a word for three lines
    np.testing.assert_allclose(ratio(50721)[:, 0] / ratio(50721)[:, 1], np.ravel(MATRIX), atol=1e-6)
    np.testing.assert_allclose(ratio(50728)[:, 0] / ratio(50728)[:, 1], NEUTRAL, atol=1e-6)
    np.testing.assert_array_equal(ratio(50714)[:, 0] / ratio(50714)[:, 1], BLACK)
    np.testing.assert_array_equal(np.reshape(tags[51041], (3, 2)), PROFILE)
    assert tuple(tags[50719]) == (4, 2)
    assert tuple(tags[50720]) == (80, 56)
    assert tags[50706] == b"\1\4\0\0"


def test_exifread_reads_the_exposure(tmp_path: Path) -> None:
    """The EXIF directory is a real one: exposure, aperture, ISO, focal length and lens."""
    import exifread

    write(tmp_path / "a.dng", mosaic(), focal_plane_px_per_mm=166.7)
    with (tmp_path / "a.dng").open("rb") as file:
        tags = exifread.process_file(file, details=False)
    number = {name: float(tags[f"EXIF {name}"].values[0]) for name in ("ExposureTime", "FNumber", "FocalLength")}
    assert number == pytest.approx({"ExposureTime": 1 / 60, "FNumber": 5.6, "FocalLength": 85.0}, abs=1e-6)
    assert tags["EXIF ISOSpeedRatings"].values == [200]
    assert float(tags["EXIF FocalPlaneXResolution"].values[0]) == pytest.approx(1667.0)
    assert tags["EXIF FocalPlaneResolutionUnit"].values == [3]
    assert str(tags["EXIF LensModel"]) == "85mm f/1.8"
    assert str(tags["Image Make"]) == "Synthetic"


@pytest.mark.skipif(shutil.which("dcraw") is None, reason="needs dcraw")
def test_dcraw_reads_every_sample(tmp_path: Path) -> None:
    """The document mode of dcraw, without scaling, gives the mosaic back."""
    import cv2

    values = mosaic()
    write(tmp_path / "a.dng", values)
    decoded = subprocess.run(["dcraw", "-D", "-4", "-t", "0", "-c", "a.dng"], cwd=tmp_path, capture_output=True)  # noqa: S607  # whichever dcraw there is
    assert decoded.returncode == 0, decoded.stderr
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(decoded.stdout, np.uint8), -1), values)


@pytest.mark.skipif(shutil.which("exiftool") is None, reason="needs exiftool")
def test_exiftool_finds_nothing_to_warn_of(tmp_path: Path) -> None:
    """The file passes exiftool's own checks, and its noise profile is found."""
    write(tmp_path / "a.dng", mosaic())
    command = ["exiftool", "-json", "-validate", "-warning", "-NoiseProfile", "a.dng"]
    found = json.loads(subprocess.run(command, cwd=tmp_path, capture_output=True, check=True).stdout)[0]
    assert found["Validate"] == "OK"
    np.testing.assert_allclose([float(v) for v in found["NoiseProfile"].split()], np.ravel(PROFILE))


def test_the_same_photograph_gives_the_same_bytes(tmp_path: Path) -> None:
    """Nothing in the file carries a time or a machine."""
    write(tmp_path / "a.dng", mosaic())
    write(tmp_path / "b.dng", mosaic())
    assert (tmp_path / "a.dng").read_bytes() == (tmp_path / "b.dng").read_bytes()


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disc filling up harms no file that was there."""
    write(tmp_path / "a.dng", mosaic())
    before = (tmp_path / "a.dng").read_bytes()

    def full(_: int) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("toolkit.io.dng.os.fsync", full)
    with pytest.raises(OSError, match="no space"):
        write(tmp_path / "a.dng", mosaic(seed=2))
    assert [p.name for p in tmp_path.iterdir()] == ["a.dng"]
    assert (tmp_path / "a.dng").read_bytes() == before


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"cfa": "RGBG"}, "cfa is 'RGBG'"),
        ({"black": 65000, "white": 65000}, "black < white"),
        ({"white": 70000}, "white 70000"),
        ({"orientation": 9}, "orientation is 9"),
        ({"crop": (90, 0, 10, 10)}, "crop"),
        ({"noise_profile": [[-1.0, 0.0]]}, "noise_profile"),
        ({"exposure_s": -1.0}, "-1.0 does not fit"),
    ],
)
def test_numbers_that_a_dng_cannot_hold_are_refused(tmp_path: Path, changed: dict, found: str) -> None:
    """The error says what was found; nothing is written."""
    with pytest.raises(ValueError, match=found):
        write(tmp_path / "a.dng", mosaic(), **changed)
    assert not list(tmp_path.iterdir())


def test_a_mosaic_of_floats_is_refused(tmp_path: Path) -> None:
    """Only what the file can hold exactly is accepted."""
    with pytest.raises(ValueError, match="float64 of shape"):
        write(tmp_path / "a.dng", mosaic().astype(float))
