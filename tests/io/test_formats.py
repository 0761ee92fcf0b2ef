"""EXR, PNG, TIFF, Radiance and 8-bit images: what is linear, what is encoded, what is refused."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest

from tests import realdata
from tests.io import good
from toolkit.errors import BadInputError
from toolkit.io.read import read, read_in_process

SIXTEEN = (good.picture() * 65_535).astype(np.uint16)
EIGHT = (good.picture() * 255).astype(np.uint8)


def profile(curve):
    """The least of an ICC profile: three equal tone curves."""
    names = (b"rTRC", b"gTRC", b"bTRC")
    tags = b"".join(struct.pack(">4sII", name, 132 + 36, len(curve)) for name in names)
    return bytes(128) + struct.pack(">I", 3) + tags + curve


STRAIGHT = profile(b"curv" + bytes(4) + struct.pack(">I", 0))
GAMMA_ONE = profile(b"para" + bytes(8) + struct.pack(">I", 1 << 16))
GAMMA_TWO = profile(b"curv" + bytes(4) + struct.pack(">IH", 1, 0x0200))


def iccp(body):
    """A PNG's iCCP chunk."""
    return (b"iCCP", b"made here\0\0" + zlib.compress(body))


@pytest.mark.parametrize(
    ("chunks", "encoding"),
    [
        ((), "linear"),
        (((b"gAMA", struct.pack(">I", 100_000)),), "linear"),
        (((b"gAMA", struct.pack(">I", 45_455)),), "encoded"),
        (((b"sRGB", b"\0"),), "encoded"),
        (((b"cICP", bytes([9, 16, 0, 1])),), "encoded"),
        (((b"cICP", bytes([1, 8, 0, 1])),), "linear"),
        ((iccp(STRAIGHT),), "linear"),
        ((iccp(GAMMA_TWO),), "encoded"),
        (((b"iCCP", b"no profile"),), "encoded"),
    ],
)
def test_a_16_bit_png_is_linear_unless_it_names_a_curve(tmp_path, chunks, encoding):
    """A gAMA of one, linear cICP and straight ICC curves are no curve."""
    frame = read_in_process(good.png(tmp_path / "a.png", chunks=chunks))
    assert frame.encoding == encoding
    assert np.array_equal(frame.values, SIXTEEN)
    assert frame.white.tolist() == [65_535.0] * 3


@pytest.mark.parametrize(
    ("options", "encoding"),
    [
        ({}, "linear"),
        ({"compression": "zlib", "predictor": True}, "linear"),
        ({"planarconfig": "separate"}, "linear"),
        ({"byteorder": ">"}, "linear"),
        ({"bigtiff": True}, "linear"),
        ({"iccprofile": GAMMA_ONE}, "linear"),
        ({"iccprofile": GAMMA_TWO}, "encoded"),
        ({"tile": (16, 16)}, "linear"),
    ],
)
def test_a_16_bit_tiff_is_linear_unless_it_names_a_curve(tmp_path, options, encoding):
    """Whatever its layout, byte order or compression."""
    stored = np.moveaxis(SIXTEEN, -1, 0) if "planarconfig" in options else SIXTEEN
    frame = read_in_process(good.tiff(tmp_path / "a.tif", stored, **options))
    assert frame.encoding == encoding
    assert frame.values.dtype == np.uint16
    assert np.array_equal(frame.values, SIXTEEN)


def test_an_lzw_tiff_is_read(tmp_path):
    """A compression that tifffile leaves to OpenCV."""
    import cv2

    path = tmp_path / "a.tif"
    assert cv2.imwrite(str(path), SIXTEEN[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, 5])
    assert np.array_equal(read_in_process(path).values, SIXTEEN)


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_a_float_tiff_is_linear_without_a_ceiling(tmp_path, kind):
    """Halves become float32; nothing clips."""
    stored = (good.picture() * 7 - 1).astype(kind)
    frame = read_in_process(good.tiff(tmp_path / "a.tif", stored))
    assert frame.values.dtype == np.float32
    assert np.array_equal(frame.values, stored.astype(np.float32))
    assert np.all(np.isinf(frame.white))


def test_a_turned_tiff_stands_upright(tmp_path):
    """The orientation tag is applied."""
    path = good.tiff(tmp_path / "a.tif", extratags=[(274, 3, 1, 6, True)])
    assert np.array_equal(read_in_process(path).values, np.rot90(SIXTEEN, -1))


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda path: good.png(path, EIGHT), "a.png"),
        (lambda path: good.tiff(path, EIGHT), "a.tif"),
        (good.tga, "a.tga"),
    ],
)
def test_eight_bits_are_encoded(tmp_path, make, name):
    """They hold too few steps to be linear."""
    frame = read_in_process(make(tmp_path / name))
    assert frame.encoding == "encoded"
    assert np.array_equal(frame.values, EIGHT)
    assert frame.white.tolist() == [255.0] * 3


def test_a_photograph_of_the_gray_ball_is_read():
    """A TGA of unknown making."""
    frame = read(realdata.folder("chrome_and_gray_ball") / "gray" / "gray.0.tga")
    assert frame.values.shape == (340, 512, 3)
    assert frame.encoding == "encoded"


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda path: good.png(path, SIXTEEN[..., 0]), "a.png"),
        (lambda path: good.tiff(path, SIXTEEN[..., 0]), "a.tif"),
        (lambda path: good.exr(path, {"Y": SIXTEEN[..., 0].astype(np.float32)}), "a.exr"),
    ],
)
def test_one_channel_is_refused(tmp_path, make, name):
    """Colour is what the separation lives on."""
    with pytest.raises(BadInputError, match=r"one channel|R, G and B"):
        read_in_process(make(tmp_path / name))


def test_alpha_is_left_out(tmp_path):
    """Of four channels the first three count."""
    stored = np.dstack([SIXTEEN, np.full(SIXTEEN.shape[:2], 9, np.uint16)])
    import cv2

    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", stored[..., [2, 1, 0, 3]])[1].tobytes())
    assert np.array_equal(read_in_process(tmp_path / "a.png").values, SIXTEEN)


def test_radiance_decodes_to_its_floats(tmp_path):
    """Shared exponents hold eight bits: within one part in 128 of the largest channel."""
    stored = good.picture().astype(np.float32) * 5
    frame = read_in_process(good.radiance(tmp_path / "a.hdr", stored))
    assert np.abs(frame.values - stored).max(axis=-1) == pytest.approx(0, abs=float(stored.max()) / 128)
    assert frame.encoding == "linear"
    assert np.all(np.isinf(frame.white))


def test_radiance_notes_what_it_did_not_divide_out(tmp_path):
    """Values are as stored; an EXPOSURE line is told of."""
    path = good.radiance(tmp_path / "a.hdr")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"FORMAT=", b"EXPOSURE=2.0\nFORMAT=", 1))
    assert "EXPOSURE" in read_in_process(path).metadata.notes[0]
    path.write_bytes(data.replace(b"32-bit_rle_rgbe", b"32-bit_rle_xyze", 1))
    with pytest.raises(BadInputError, match="XYZ"):
        read_in_process(path)


def float_planes(height=48, width=64):
    """R, G, B with distinct values."""
    rgb = good.picture(height, width).astype(np.float32)
    return {name: np.ascontiguousarray(rgb[..., i]) for i, name in enumerate("RGB")}


@pytest.mark.parametrize("kind", [np.float32, np.float16])
def test_an_exr_comes_as_stored(tmp_path, kind):
    """Floats and halves, above one and below zero."""
    planes = {name: (plane * 9 - 2).astype(kind) for name, plane in float_planes().items()}
    frame = read_in_process(good.exr(tmp_path / "a.exr", planes))
    assert frame.values.dtype == np.float32
    for channel, name in enumerate("RGB"):
        assert np.array_equal(frame.values[..., channel], planes[name].astype(np.float32))


def test_an_exrs_frame_is_its_display_window(tmp_path):
    """Data inside it lie in their place, the rest is NaN; data outside it are cut off."""
    window = {"dataWindow": ((10, 20), (73, 67)), "displayWindow": ((0, 0), (99, 59))}
    planes = float_planes()
    values = read_in_process(good.exr(tmp_path / "a.exr", planes, window)).values
    assert values.shape == (60, 100, 3)
    assert np.array_equal(values[20:60, 10:74, 1], planes["G"][:40])
    assert np.isnan(values[:20]).all()
    assert np.isnan(values[:, 74:]).all()


def test_an_exrs_first_layer_serves_where_nothing_is_plain(tmp_path):
    """Channels named layer.R and so on; other channels beside them are left alone."""
    planes = {f"beauty.{name}": plane for name, plane in float_planes().items()}
    planes["depth.Z"] = planes["beauty.R"]
    values = read_in_process(good.exr(tmp_path / "a.exr", planes)).values
    assert np.array_equal(values[..., 2], planes["beauty.B"])


def test_an_exrs_channels_are_told_in_printable_letters(tmp_path):
    """A name out of the file that holds a control character, the reader isolated or not."""
    path = good.exr(tmp_path / "a.exr")
    path.write_bytes(path.read_bytes().replace(b"R\0", b"\x7f\0", 1))
    for reader in (read, read_in_process):
        with pytest.raises(BadInputError) as caught:
            reader(path)
        assert "channels B, G, ; R, G and B are needed" in str(caught.value)


def test_an_exr_tells_of_its_camera(tmp_path):
    """The standard attributes."""
    told = read_in_process(good.exr(tmp_path / "a.exr", header={"expTime": 0.5, "cameraMake": "Pico"})).metadata
    assert (told.exposure_s, told.make) == (0.5, "Pico")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.full((48, 64, 3), 0.5, np.float32), "every sample is the same"),
        (np.full((48, 64, 3), np.nan, np.float32), "no sample is a finite number"),
        (good.picture(6, 64).astype(np.float32), "64 x 6 pixels"),
    ],
)
def test_what_decodes_to_nothing_is_refused(tmp_path, values, message):
    """Constant, without a finite number, or a few pixels high."""
    planes = {name: np.ascontiguousarray(values[..., i]) for i, name in enumerate("RGB")}
    with pytest.raises(BadInputError, match=message):
        read_in_process(good.exr(tmp_path / "a.exr", planes))


def test_the_content_decides_not_the_suffix(tmp_path):
    """A PNG named .dng is read as the PNG it is; a TIFF with raw tags named .tif as a raw."""
    assert read_in_process(good.png(tmp_path / "a.dng")).format == "png"
    assert read_in_process(good.dng(tmp_path / "a.tif")).format == "raw"
