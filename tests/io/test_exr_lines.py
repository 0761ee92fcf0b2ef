"""OpenEXR files that are put together here, as OpenEXR reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from toolkit.io import exr_lines
from toolkit.io.exr_lines import write_lines


@pytest.mark.parametrize("band", [1, 4000, 1 << 20])
def test_openexr_reads_every_number_back(band: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Channels of any order in memory and number of bands, in their window; 0 for what is no number."""
    monkeypatch.setattr(exr_lines, "BAND_BYTES", band)
    picture = np.random.default_rng(0).normal(size=(37, 21, 3)).astype(np.float32)
    picture[5, 6], picture[7, 8, 2] = np.nan, np.inf
    channels = {"model.R": picture[..., 0], "model.G": picture[..., 1], "body.B": picture[..., 2].astype(float)}
    write_lines(tmp_path / "x.exr", channels, corner=(4, 3), display=(64, 48))
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        header = dict(file.header())
        found = {name: channel.pixels.copy() for name, channel in file.channels().items()}
    assert np.array(header["dataWindow"]).tolist() == [[4, 3], [24, 39]]
    assert np.array(header["displayWindow"]).tolist() == [[0, 0], [63, 47]]
    assert header["compression"] == OpenEXR.NO_COMPRESSION
    assert set(found) == set(channels)
    for name, channel in channels.items():
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], np.where(np.isfinite(channel), channel, 0.0).astype(np.float32))


def test_what_openexr_writes_is_the_same_but_for_its_header(tmp_path: Path) -> None:
    """The pixels of both files, bytes and all."""
    channels = {name: np.full((3, 2), number, np.float32) for name, number in (("B", 1.0), ("G", 2.0), ("R", 3.0))}
    write_lines(tmp_path / "own.exr", channels, corner=(0, 0), display=(2, 3))
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as file:
        file.write(str(tmp_path / "theirs.exr"))
    pixels = 3 * (8 + 3 * 2 * 4)
    own, theirs = ((tmp_path / f"{name}.exr").read_bytes() for name in ("own", "theirs"))
    assert own[-pixels:] == theirs[-pixels:]
