"""The files of a result: what is in them, and that they appear whole or not at all."""

from __future__ import annotations

import json
import resource
import signal
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from pipelines.report import scanlines, write
from pipelines.report.folder import whole
from pipelines.report.layers_exr import LayersFile, write_layers
from pipelines.report.write import output_names, write_outputs
from pipelines.settings import Settings
from tests.pipelines import fakes
from toolkit.errors import FitMaterialError, UsageError
from toolkit.records import MaterialReport


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report()


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.fixture(scope="module")
def written(report: MaterialReport, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The path of the JSON of a result with all its files, in a folder that did not exist."""
    out = tmp_path_factory.mktemp("written") / "a" / "ball.fit"
    return write_outputs(report, out, Settings(), exports=("gltf",))


def test_every_file_of_the_design_is_written(written: Path) -> None:
    """JSON, run, page, posterior, layers, settings and an export, and nothing else; the path of the JSON comes back."""
    assert written.name == "ball.json"
    made = files(written.parent)
    assert made == {
        "ball.json",
        "ball.run.json",
        "ball.html",
        "ball.posterior.nc",
        "ball.layers.exr",
        "ball.settings.toml",
        "ball.gltf",
    }
    assert made == set(output_names("ball.dng", exports=("gltf",)))
    run = json.loads((written.parent / "ball.run.json").read_text())
    assert run["seconds"]["fit"] == 0.8
    assert run["seconds"]["write.html"] > 0
    assert "written" in run
    assert Settings.model_validate(tomllib.loads((written.parent / "ball.settings.toml").read_text())) == Settings()


def test_all_but_the_run_file_repeat_byte_for_byte(written: Path, tmp_path: Path) -> None:
    """Two runs of the same report give the same bytes of everything that carries no clock."""
    again = write_outputs(fakes.report(), tmp_path, Settings(), exports=("gltf",)).parent
    for name in files(again) - {"ball.run.json"}:
        assert (written.parent / name).read_bytes() == (again / name).read_bytes(), name


def test_no_page_is_written_where_none_is_wanted(report: MaterialReport, tmp_path: Path) -> None:
    """An old page goes, so that nobody takes it for the new result's; what is not ours stays."""
    (tmp_path / "ball.html").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    write_outputs(report, tmp_path, page=False)
    assert "ball.html" not in files(tmp_path)
    assert "notes.txt" in files(tmp_path)


def test_no_name_leaves_the_folder(tmp_path: Path) -> None:
    """A photograph named like a path to elsewhere is written where it was told."""
    out = tmp_path / "x" / "y" / "out"
    write_outputs(fakes.hostile_report(), out, page=False, exports=("materialx", "pbrt"))
    assert {path.parent for path in tmp_path.rglob("*") if path.is_file()} == {out}
    assert files(tmp_path) - files(out) >= {"x", "x/y", "x/y/out"}


def test_an_error_on_the_way_leaves_everything_as_it_was(
    report: MaterialReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a new folder nor a changed old one, and no draft."""
    out = tmp_path / "out"
    write_outputs(report, out, page=False)
    before = {name: (out / name).read_bytes() for name in files(out)}
    monkeypatch.setattr(write, "_page", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_outputs(replace(report, preferred=None), out)
    assert {name: (out / name).read_bytes() for name in files(out)} == before
    with pytest.raises(ZeroDivisionError):
        write_outputs(report, tmp_path / "new")
    assert files(tmp_path) == {"out", *(f"out/{name}" for name in before)}


def test_an_interrupt_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C between two files is like an error."""

    def interrupted() -> None:
        with whole(tmp_path / "out", last="a") as draft:
            (draft / "a").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert files(tmp_path) == set()


@contextmanager
def full_at(size: int) -> Iterator[None]:
    """No file may grow beyond `size` bytes, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("size", [500, 20_000, 200_000, 300_000])
def test_a_full_disk_leaves_nothing_and_says_so_in_one_line(report: MaterialReport, tmp_path: Path, size: int) -> None:
    """Whichever file it hits first: JSON, posterior, layers or run file."""
    with full_at(size), pytest.raises(FitMaterialError, match="free some space") as caught:
        write_outputs(report, tmp_path / "out", page=False)
    assert "\n" not in str(caught.value)
    assert files(tmp_path) == set()


def test_layers_that_the_disk_does_not_take_are_an_os_error(report: MaterialReport, tmp_path: Path) -> None:
    """The disk's reason reaches the caller."""
    assert report.layers is not None
    with full_at(10_000), pytest.raises(OSError, match="File too large"):
        write_layers(tmp_path / "x.exr", report.layers, report.image)


def test_a_folder_that_cannot_be_made_is_the_callers_mistake(report: MaterialReport, tmp_path: Path) -> None:
    """A file stands where the folder should be."""
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(UsageError, match="--out"):
            write_outputs(report, out, page=False)


def test_an_unknown_export_is_refused_before_anything_is_written(report: MaterialReport, tmp_path: Path) -> None:
    """The line names what there is."""
    with pytest.raises(UsageError, match="mitsuba"):
        write_outputs(report, tmp_path / "out", page=False, exports=("word",))
    assert files(tmp_path) == set()


def test_the_json_comes_last_and_an_old_one_goes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever finds STEM.json finds the rest of the same run beside it."""
    (tmp_path / "a.json").write_text("old")
    order: list[str] = []
    move = Path.replace

    def watched(self: Path, target: Path) -> Path:
        order.append(target.name)
        assert target.name == "a.json" or not (tmp_path / "a.json").exists()
        return move(self, target)

    monkeypatch.setattr(Path, "replace", watched)
    with whole(tmp_path, last="a.json") as draft:
        for name in ("a.json", "z.nc", "b.exr"):
            (draft / name).write_text("new")
    assert order == ["b.exr", "z.nc", "a.json"]


def test_layers_lie_in_their_window_of_the_image(report: MaterialReport, tmp_path: Path) -> None:
    """Half resolution for a mosaic, 0 off the sphere; the parts add up to the model, with the rest to the photo."""
    layers = report.layers
    assert layers is not None
    write_layers(tmp_path / "x.exr", layers, report.image)
    with OpenEXR.File(str(tmp_path / "x.exr"), separate_channels=True) as file:
        windows = {name: np.array(file.header()[name]).tolist() for name in ("displayWindow", "dataWindow")}
        channels = {name: channel.pixels.copy() for name, channel in file.channels().items()}
    assert windows["displayWindow"] == [[0, 0], [159, 119]]
    low, high = windows["dataWindow"]
    assert low == [(int(layers.origin_px[0] - 0.5)) // 2, (int(layers.origin_px[1] - 0.5)) // 2]
    assert (high[1] - low[1] + 1, high[0] - low[0] + 1) == layers.diffuse.shape[:2]
    assert set(channels) == {f"{layer}.{c}" for layer in ("diffuse", "specular", "model", "residual") for c in "RGB"}
    on = np.isfinite(layers.model[..., 1])
    assert channels["model.G"].dtype == np.float32
    assert not channels["model.G"][~on].any()
    total = channels["diffuse.G"] + channels["specular.G"] + np.float32(layers.pedestal[1])
    np.testing.assert_allclose(total[on], channels["model.G"][on], rtol=1e-5)
    again = channels["model.G"] + channels["residual.G"]
    np.testing.assert_allclose(again[on], layers.photograph[..., 1][on], rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("at_a_time", [1, 10_000, scanlines.AT_A_TIME])
def test_the_layers_bytes_are_openexrs_own(
    report: MaterialReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_a_time: int
) -> None:
    """However many lines are made at a time, in whatever order, and wherever the disk is asked to take them; NaN and
    infinity are 0.
    """
    monkeypatch.setattr(scanlines, "AT_A_TIME", at_a_time)
    monkeypatch.setattr(scanlines, "SENT", 20_000)
    assert report.layers is not None
    photograph = report.layers.photograph.copy()
    photograph[::7] = np.inf
    layers = replace(report.layers, photograph=photograph)
    ours = LayersFile.begin(tmp_path / "ours.exr", layers, report.image)
    for rows in (slice(17, len(layers.used)), slice(17)):
        ours.write(layers, slice(*rows.indices(len(layers.used))[:2]))
    with OpenEXR.File(str(tmp_path / "ours.exr"), separate_channels=True) as file:
        window = {name: file.header()[name] for name in ("displayWindow", "dataWindow")}
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage, **window}
    channels = {
        f"{name}.{letter}": np.nan_to_num(getattr(layers, name)[..., c], nan=0.0, posinf=0.0, neginf=0.0)
        for name in ("diffuse", "specular", "model", "residual")
        for c, letter in enumerate("RGB")
    }
    with OpenEXR.File(header, channels) as file:
        file.write(str(tmp_path / "theirs.exr"))
    assert (tmp_path / "ours.exr").read_bytes() == (tmp_path / "theirs.exr").read_bytes()
