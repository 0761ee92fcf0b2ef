"""Damaged files and bombs: a clear line or a correct picture, within ten seconds and a gigabyte."""

from __future__ import annotations

import resource
import struct
import time
import zlib

import numpy as np
import pytest

from tests import realdata
from tests.io import good
from tests.io.sweep import sweep
from toolkit.errors import BadInputError
from toolkit.io.read import read, read_in_process

GIGABYTE = 1e9


def clear_line(text):
    """Whether an error is one printable line that says more than that something failed."""
    return "\n" not in text and text.isprintable() and 30 < len(text) < 500


def complaint_about(path):
    """The public path's error on a file; a line that says so where it decodes."""
    try:
        return f"no error, but a picture of shape {read(path).values.shape}"
    except BadInputError as error:
        return str(error)


def check(outcomes):
    """Every outcome a clear line or a picture, within the limits; what killed the worker is read the public way."""
    for outcome in outcomes:
        if outcome.died:
            with pytest.raises(BadInputError) as caught:
                read(outcome.path)
            assert clear_line(str(caught.value)), outcome.path
            continue
        assert clear_line(outcome.error) or (not outcome.error and len(outcome.shape) in (2, 3)), outcome
        assert outcome.cpu_s < 10, outcome
        assert outcome.peak_bytes < GIGABYTE, outcome


def write_mutants(folder, count, seed):
    """`count` mutants of good files of every kind, and the pixels' digests of the good ones by suffix."""
    rng = np.random.default_rng(seed)
    originals = good.all_kinds(folder)
    real = realdata.folder("raw") / "colorchart.dng"
    paths = []
    for number in range(count):
        source = originals[number % len(originals)] if number % 50 else real
        path = folder / f"mutant{number}{source.suffix}"
        path.write_bytes(good.mutant(source.read_bytes(), rng))
        paths.append(path)
    return originals, paths


@pytest.mark.parametrize("folder", ["raw/broken", "damaged/openexr_tests", "damaged/openimageio", "damaged/tinyexr"])
def test_files_that_broke_decoders_end_in_a_clear_line_or_a_picture(folder):
    """Fuzzers' finds and half-broken raws, decoded under the limits."""
    outcomes = sweep(sorted(realdata.folder(folder).iterdir()))
    check(outcomes)
    assert any(outcome.error for outcome in outcomes)


@pytest.mark.parametrize("name", ["DNG.dng", "IMG_1361.dng", "Panasonic.rw2", "Nikon_uncompressed.nef", "CanonRaw.cr2"])
def test_raws_that_decode_to_nothing_or_garbage_are_refused(name):
    """Files that LibRaw opens, some without error: each is refused by the public path."""
    with pytest.raises(BadInputError) as caught:
        read(realdata.folder("raw/broken") / name)
    assert clear_line(str(caught.value))


def test_mutants_end_in_a_clear_line_or_a_picture(tmp_path):
    """2,000 mutants of good files of every kind."""
    outcomes = sweep(write_mutants(tmp_path, 2000, seed=1)[1])
    check(outcomes)
    assert 200 < sum(bool(outcome.error) for outcome in outcomes) < 1800  # both ends are reached


def test_a_damaged_png_never_passes_for_a_good_one(tmp_path):
    """PNG carries checksums: a mutant decodes to the original's pixels or not at all."""
    source, rng = good.png(tmp_path / "good.png"), np.random.default_rng(2)
    paths = [tmp_path / f"{number}.png" for number in range(60)]
    for path in paths:
        path.write_bytes(good.mutant(source.read_bytes(), rng))
    outcomes = sweep([source, *paths])
    assert not outcomes[0].error
    assert {outcome.digest for outcome in outcomes if not outcome.error} == {outcomes[0].digest}


@pytest.mark.slow
def test_every_fuzzers_file_the_public_way():
    """All damaged files through the isolated path: exit is a BadInputError or a picture; the parent survives."""
    for folder in ("raw/broken", "damaged/openexr", "damaged/openexr_tests", "damaged/openimageio", "damaged/tinyexr"):
        for path in sorted(realdata.folder(folder).iterdir()):
            started = time.monotonic()
            assert clear_line(complaint_about(path)), path
            assert time.monotonic() - started < 10, path
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 < GIGABYTE


@pytest.mark.slow
def test_ten_thousand_mutants(tmp_path):
    """10,000 mutants, in portions."""
    for portion in range(10):
        folder = tmp_path / str(portion)
        folder.mkdir()
        paths = write_mutants(folder, 1000, seed=100 + portion)[1]
        check(sweep(paths))
        for path in paths:
            path.unlink()


@pytest.mark.slow
def test_mutants_the_public_way(tmp_path):
    """300 mutants, each in a process of its own."""
    for path in write_mutants(tmp_path, 300, seed=3)[1]:
        assert clear_line(complaint_about(path)), path


def png_bomb(path, side):
    """A PNG of `side` x `side` black 16-bit RGB pixels, a thousandth of their size."""
    row = zlib.compressobj(9)
    packed = b"".join(row.compress(bytes(1 + 6 * side)) for _ in range(side)) + row.flush()
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", side, side, 16, 2, 0, 0, 0)), (b"IDAT", packed), (b"IEND", b"")]
    coded = (struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(coded))
    return path


def exr_bomb(path, side):
    """An EXR of zeros."""
    zeros = np.zeros((side, side), np.float16)
    return good.exr(path, channels=dict.fromkeys("RGB", zeros))


def hdr_bomb(path):
    """A Radiance header that claims 40,000 x 40,000 pixels."""
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 40000\n" + bytes(100))
    return path


def tiff_bomb(path):
    """A deflated TIFF of zeros."""
    return good.tiff(path, values=np.zeros((6000, 6000, 3), np.uint16), compression="zlib")


def dng_bomb(path):
    """A DNG whose header claims 30,000 x 30,000 samples."""
    good.dng(path)
    data = bytearray(path.read_bytes())
    for tag in (256, 257):
        at = data.index(struct.pack("<HHI", tag, 4, 1))
        data[at + 8 : at + 12] = struct.pack("<I", 30_000)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    "make",
    [
        lambda folder: png_bomb(folder / "bomb.png", 6000),
        lambda folder: exr_bomb(folder / "bomb.exr", 4000),
        lambda folder: hdr_bomb(folder / "bomb.hdr"),
        lambda folder: tiff_bomb(folder / "bomb.tif"),
        lambda folder: dng_bomb(folder / "bomb.dng"),
    ],
    ids=["png", "exr", "hdr", "tiff", "dng"],
)
def test_bombs_are_refused_before_they_decode(tmp_path, make):
    """A small file that claims to be huge: refused with little processor time and memory."""
    path = make(tmp_path)
    before = time.process_time()
    with pytest.raises(BadInputError, match=r"claims? (to hold )?\d+ x \d+|cut short") as caught:
        read_in_process(path)
    assert time.process_time() - before < 1
    assert clear_line(str(caught.value))
    with pytest.raises(BadInputError):
        read(path)
