"""Camera raws: the mosaic as stored, its black, white, pattern, place and orientation."""

from __future__ import annotations

import shutil
import struct
import subprocess
from types import SimpleNamespace

import numpy as np
import pytest

from tests import realdata
from tests.io import good
from toolkit.errors import BadInputError
from toolkit.io import raw
from toolkit.io.read import read_in_process

CHANNELS = {"R": 0, "G": 1, "B": 2}


def dcraw(path):
    """The mosaic as dcraw decodes it: no demosaic, no scaling."""
    program = shutil.which("dcraw")
    if program is None:
        pytest.skip("needs dcraw: apt-get install dcraw")
    coded = subprocess.run([program, "-D", "-4", "-c", str(path)], capture_output=True, check=True).stdout
    _, size, _, pixels = coded.split(b"\n", 3)
    width, height = (int(side) for side in size.split())
    return np.frombuffer(pixels, ">u2").reshape(height, width)


def test_a_lossless_dng_decodes_bit_for_bit_as_with_dcraw():
    """Every visible sample of the chart, its masked borders left out."""
    path = realdata.folder("raw") / "colorchart.dng"
    assert np.array_equal(read_in_process(path).values, dcraw(path))


def test_a_lossy_dng_decodes_as_with_dcraw_but_for_rounding():
    """Blackmagic.dng holds 12-bit cosine-transform JPEG, whose last bit the standard leaves to the decoder.

    All but 0.02 % of the samples agree; those differ by one step of its table, or dcraw overshoots the table's end.
    """
    path = realdata.folder("raw") / "Blackmagic.dng"
    frame, other = read_in_process(path), dcraw(path).astype(int)
    assert frame.values.shape == other.shape == (2176, 4128)
    ours = frame.values.astype(int)
    apart = ours != other
    assert np.count_nonzero(apart) < 2e-4 * apart.size
    step = np.maximum(ours, other) * 2.0**-8 + 8  # its table is logarithmic
    table_end = ours >= 65_216
    assert np.all((np.abs(ours - other) <= step)[apart & ~table_end])


def test_our_own_dng_decodes_bit_for_bit_as_with_dcraw(tmp_path):
    """What is written is read, by both."""
    path = good.dng(tmp_path / "a.dng")
    assert np.array_equal(read_in_process(path).values, good.mosaic())
    assert np.array_equal(dcraw(path), good.mosaic())


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_every_position_has_its_own_black_and_channel(tmp_path, pattern):
    """Black levels come by position, not by LibRaw's colour index."""
    frame = read_in_process(good.dng(tmp_path / "a.dng", cfa=pattern, black=(500, 510, 520, 530)))
    assert frame.cfa is not None
    assert [CHANNELS[letter] for letter in pattern] == frame.cfa.ravel().tolist()
    assert frame.black.ravel().tolist() == [500, 510, 520, 530]
    assert np.all(frame.white == 15_871)


# how a stored array is brought upright, written out by EXIF's own words for rows and columns
UPRIGHT = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.T,
    6: lambda a: np.rot90(a, -1),
    7: lambda a: a[::-1, ::-1].T,
    8: lambda a: np.rot90(a),
}


@pytest.mark.parametrize("code", range(1, 9))
@pytest.mark.parametrize("size", [(48, 64), (47, 64), (48, 63), (47, 63)])
def test_the_orientation_turns_mosaic_and_pattern_together(tmp_path, code, size):
    """For all eight EXIF codes and any parity of the sides each sample keeps its value, channel and black."""
    stored = good.mosaic(48, 64)[: size[0], : size[1]]
    frame = read_in_process(good.dng(tmp_path / "a.dng", stored, orientation=code, black=(500, 510, 520, 530)))
    assert np.array_equal(frame.values, UPRIGHT[code](stored))
    rows, columns = np.indices(size)
    channel = UPRIGHT[code](np.array([[0, 1], [1, 2]])[rows % 2, columns % 2])
    black = UPRIGHT[code](np.array([[500, 510], [520, 530]])[rows % 2, columns % 2])
    assert np.array_equal(frame.cfa, channel[:2, :2])
    assert np.array_equal(frame.black, black[:2, :2])


def test_the_default_crop_cuts_no_samples(tmp_path):
    """DefaultCrop is a developer's frame; every visible sample is a measurement, counted from the first of them."""
    frame = read_in_process(good.dng(tmp_path / "a.dng", crop=(8, 4, 40, 30)))
    assert frame.values.shape == (48, 64)


def test_the_masked_border_is_no_part_of_the_picture():
    """The chart's sensor is 1888 x 1182; its active area begins at 152, 26."""
    path = realdata.folder("raw") / "colorchart.dng"
    frame = read_in_process(path)
    import rawpy

    with rawpy.imread(str(path)) as whole:
        assert np.array_equal(frame.values, whole.raw_image[26 : 26 + 1156, 152 : 152 + 1734])


def linear_dng(path, values):
    """A DNG whose samples are linear colours, or one channel, already: no mosaic."""
    import tifffile

    version, camera = (50706, 1, 4, bytes((1, 4, 0, 0)), True), (50708, 2, 0, "Pico", True)
    kind = 2 if values.ndim == 3 else 1
    tifffile.imwrite(path, values, photometric=kind, extratags=[version, camera], metadata=None)
    plain, linear = (struct.pack("<HHIHH", 262, 3, 1, code, 0) for code in (kind, 34892))  # PhotometricInterpretation
    path.write_bytes(path.read_bytes().replace(plain, linear, 1))
    return path


def test_a_linear_dng_gives_three_colours(tmp_path):
    """Without a mosaic the samples are the pixels, as stored."""
    stored = (good.picture() * 60_000).astype(np.uint16)
    frame = read_in_process(linear_dng(tmp_path / "a.dng", stored))
    assert frame.cfa is None
    assert frame.encoding == "linear"
    assert np.array_equal(frame.values, stored)
    assert frame.white.tolist() == [65_535.0] * 3


def test_a_monochrome_raw_is_refused(tmp_path):
    """One channel separates nothing."""
    stored = (good.picture()[..., 0] * 60_000).astype(np.uint16)
    with pytest.raises(BadInputError, match="one channel"):
        read_in_process(linear_dng(tmp_path / "a.dng", stored))


def test_other_mosaics_are_refused():
    """X-Trans by its size, four-colour sensors by their letters."""
    xtrans = SimpleNamespace(color_desc=b"RGBG", raw_pattern=np.zeros((6, 6), np.uint8), num_colors=3)
    with pytest.raises(BadInputError, match="6 x 6"):
        raw._colour_tile(xtrans)
    pattern = np.array([[0, 1], [2, 3]], np.uint8)
    emerald = SimpleNamespace(
        color_desc=b"RGBE",
        raw_pattern=pattern,
        num_colors=4,
        sizes=SimpleNamespace(top_margin=0, left_margin=0),
        raw_color=lambda row, column: pattern[row, column],
    )
    with pytest.raises(BadInputError, match="BEGR"):
        raw._colour_tile(emerald)


def test_a_foveon_raw_is_refused(tmp_path):
    """Its three layers are no camera colours."""
    (tmp_path / "a.x3f").write_bytes(b"FOVb" + bytes(5000))
    with pytest.raises(BadInputError, match="Foveon"):
        read_in_process(tmp_path / "a.x3f")


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6, 0.9, 0.999])
def test_a_raw_cut_short_is_refused(tmp_path, share):
    """However little is missing."""
    data = (realdata.folder("raw") / "colorchart.dng").read_bytes()
    (tmp_path / "cut.dng").write_bytes(data[: int(share * len(data))])
    with pytest.raises(BadInputError, match="cut short"):
        read_in_process(tmp_path / "cut.dng")


def test_the_metadata_are_those_written(tmp_path):
    """Exposure, lens and colour tags; the noise profile by channel."""
    told = read_in_process(good.dng(tmp_path / "a.dng", make="Pico", model="Cam 1", lens="50mm f/2")).metadata
    assert (told.make, told.model, told.lens) == ("Pico", "Cam 1", "50mm f/2")
    assert told.exposure_s == pytest.approx(1 / 60)
    assert (told.iso, told.f_number, told.focal_length_mm) == (200, 8, 50)
    assert told.noise_profile == ((1e-4, 1e-7), (2e-4, 2e-7), (3e-4, 3e-7))
    assert told.xyz_to_camera[1] == pytest.approx((-0.4, 1.2, 0.2))
    assert told.as_shot_neutral == pytest.approx((0.5, 1.0, 0.7))
    assert told.notes == ()


def test_noise_is_garbage(tmp_path):
    """Random numbers in a raw's place: neighbours unrelated, refused."""
    noise = np.random.default_rng(1).integers(0, 16_000, (200, 300)).astype(np.uint16)
    with pytest.raises(BadInputError, match="unrelated"):
        read_in_process(good.dng(tmp_path / "a.dng", noise))


def test_a_dark_frame_is_a_photograph(tmp_path):
    """Uncorrelated read noise around black is no garbage."""
    dark = np.random.default_rng(1).normal(512, 5, (200, 300)).round().astype(np.uint16)
    assert read_in_process(good.dng(tmp_path / "a.dng", dark)).values.shape == (200, 300)


def test_a_part_of_zeros_is_refused(tmp_path):
    """A sensor with a black level of 512 gives no rows of zeros."""
    stored = good.mosaic(200, 300)
    stored[150:] = 0
    with pytest.raises(BadInputError, match="decodes to zeros"):
        read_in_process(good.dng(tmp_path / "a.dng", stored))


def test_numbers_above_white_are_refused(tmp_path):
    """Most samples far above the stated white: another kind of file."""
    with pytest.raises(BadInputError, match="above"):
        read_in_process(good.dng(tmp_path / "a.dng", good.mosaic() + np.uint16(20_000), white=1000))


def test_a_raw_that_is_no_dng_takes_its_colours_from_the_decoder() -> None:
    """LibRaw's matrix of XYZ to camera and the white balance as shot; zeros, as for a DNG, tell nothing."""
    matrix = [[0.69, -0.19, -0.06], [-0.45, 1.24, 0.23], [-0.08, 0.21, 0.56], [0.0, 0.0, 0.0]]
    told = SimpleNamespace(rgb_xyz_matrix=np.array(matrix), camera_whitebalance=[2.0, 1.0, 1.6, 0.0])
    found = raw._colours(told)
    assert found["xyz_to_camera"] == matrix[:3]
    assert found["as_shot_neutral"] == pytest.approx([0.5, 1.0, 0.625])
    silent = SimpleNamespace(rgb_xyz_matrix=np.zeros((4, 3)), camera_whitebalance=[-1.0, 0.0, 0.0, 0.0])
    assert raw._colours(silent) == {}
