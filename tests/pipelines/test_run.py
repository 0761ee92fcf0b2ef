"""The whole run: files are begun as soon as what they hold is there, and hold what they would have held at the end."""

from __future__ import annotations

import errno
import os
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pipelines.colours
import toolkit.inference.compare
from pipelines import drawing
from pipelines.drawing import Take
from pipelines.fit_material import fit_jointly
from pipelines.report.scanlines import Scanlines
from pipelines.report.write import write_outputs, writing
from pipelines.run import run
from pipelines.workers import ALONE, Workers
from toolkit.errors import FitMaterialError
from toolkit.radiometry.quads import quads
from toolkit.records import Fit, LinearImage, ModelLayers

from .test_fit_material import ball, settings

__all__ = ["ball"]  # the fixture
TWO = {"models": ["phong", "torrance-sparrow"], "diffuse": ["lambert"], "ess": 300}
LONG_S = 60.0


def test_what_a_run_writes_is_what_its_report_would_write(ball: Path, tmp_path: Path) -> None:
    """Begun early or in the end: the same files, the same bytes."""
    asked = settings(ball, fit=TWO)
    report, result = run([(ball, asked)], tmp_path / "early", page=False)
    write_outputs(report, tmp_path / "late", asked, page=False)
    names = {path.name for path in (tmp_path / "early").iterdir()}
    assert names == {path.name for path in (tmp_path / "late").iterdir()} > {"ball.layers.exr"}
    for name in names - {"ball.run.json"}:
        assert (tmp_path / "early" / name).read_bytes() == (tmp_path / "late" / name).read_bytes(), name
    assert result["best"] == report.best


class Told:
    """Who is told of what is there before the report is, and lets rows of layers leave a mark where they are drawn."""

    def __init__(self, marks: Path) -> None:
        self.marks = marks
        self.fits_told: list[tuple[Fit, ...]] = []

    def join(self, _: Workers) -> None:
        """Nothing for the crew to do."""

    def fits(self, _: LinearImage, fits: tuple[Fit, ...], best: int) -> None:
        assert fits[best] is not None
        self.fits_told.append(fits)

    def layers(self, number: int, _: LinearImage, layers: ModelLayers) -> Take:
        return partial(_mark, self.marks, len(layers.used))


def _mark(marks: Path, height: int, layers: ModelLayers, rows: slice) -> None:
    assert np.isfinite(layers.lines(rows).diffuse).any()
    (marks / f"{rows.start}-{rows.stop} of {height}, {os.getpid()}").touch()


@pytest.mark.parametrize("processes", [1, 2])
def test_layers_are_taken_as_they_are_drawn_while_colours_are_separated(
    ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int
) -> None:
    """The separation waits here for rows to be taken: the other way round nobody would end."""
    told, separate = Told(tmp_path), pipelines.colours.separate_colours

    def waiting(*args: Any, **more: Any) -> Any:
        until = time.monotonic() + LONG_S
        while not list(tmp_path.iterdir()):
            assert time.monotonic() < until
            time.sleep(0.01)
        return separate(*args, **more)

    monkeypatch.setattr(pipelines.colours, "separate_colours", waiting)
    report = fit_jointly([(ball, settings(ball, fit=TWO))], ahead=told, processes=processes)
    assert told.fits_told == [report.fits]
    assert report.layers is not None
    marks = [path.name for path in tmp_path.iterdir()]
    assert {mark.split(",")[0] for mark in marks} == {f"0-{height} of {height}" for height in [len(report.layers.used)]}
    assert all(mark.endswith(f" {os.getpid()}") == (processes == 1) for mark in marks)


@pytest.mark.parametrize("right", [True, False])
def test_layers_drawn_ahead_are_kept_only_if_they_are_of_the_best_fit(
    ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, right: bool
) -> None:
    """While the last fit is out the likely best is drawn; where it is not the best in the end, that is drawn anew, and
    its file is written anew.
    """
    made: list[str] = []
    begin, rank = drawing.Studio.draw, toolkit.inference.compare.rank

    def watched(self: drawing.Studio, number: int, fit: Fit, *more: Any) -> drawing.Drawing:
        made.append(fit.model)
        return begin(self, number, fit, *more)

    def misled(fits: tuple[Fit, ...]) -> Any:
        best, *others = rank(fits)
        wanted = "torrance-sparrow" if right else "phong"
        first = next((i for i, fit in enumerate(fits) if fit.model == wanted), best)
        return (first if len(fits) < 4 else best, *others)

    monkeypatch.delenv(ALONE, raising=False)
    monkeypatch.setattr(drawing.Studio, "draw", watched)
    monkeypatch.setattr(drawing, "STRIP", 5000)
    monkeypatch.setattr(toolkit.inference.compare, "rank", misled)
    asked = settings(ball, fit={**TWO, "diffuse": []})
    report, _ = run([(ball, asked)], tmp_path / "early", page=False, processes=2)
    assert made == (["torrance-sparrow"] if right else ["phong", "torrance-sparrow"])
    of_best = drawing.layers_of_fit(report.image, quads(report.image), report.fits[report.best])
    write_outputs(replace(report, layers=of_best), tmp_path / "late", asked, page=False)
    early, late = (tmp_path / when / "ball.layers.exr" for when in ("early", "late"))
    assert early.read_bytes() == late.read_bytes()


@pytest.mark.parametrize("blur_px2", [0.0, 2.0])
def test_strips_make_the_whole_picture(ball: Path, monkeypatch: pytest.MonkeyPatch, blur_px2: float) -> None:
    """A channel's move to its place and the camera's blur reach from one strip into the next."""
    report = fit_jointly([(ball, settings(ball, fit={**TWO, "models": ["phong"]}))])
    fit, picture = report.fits[0], quads(report.image)
    fit = replace(fit, scene=replace(fit.scene, camera=replace(fit.scene.camera, blur_px2=blur_px2)))
    whole = drawing.layers_of_fit(report.image, picture, fit)
    monkeypatch.setattr(drawing, "STRIP", 7 * picture.values.shape[1])
    canvas = drawing.Canvas.of(report.image, picture)
    for rows in canvas.strips():
        canvas.draw(fit, rows)
    drawn = canvas.layers(fit)
    assert len(canvas.strips()) > 10
    assert drawn.origin_px == whole.origin_px
    for name in ("photograph", "diffuse", "specular", "used"):
        assert np.array_equal(getattr(drawn, name), getattr(whole, name), equal_nan=name != "used"), name


def test_a_run_that_fails_late_leaves_nothing(ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its layers were begun already."""

    def failing(*_: Any, **__: Any) -> None:
        until = time.monotonic() + LONG_S
        while not list(tmp_path.iterdir()) and time.monotonic() < until:
            time.sleep(0.01)  # for the draft
        raise FitMaterialError("no colours today")

    monkeypatch.setattr("pipelines.srgb.colour_of", failing)
    with pytest.raises(FitMaterialError, match="no colours"):
        run([(ball, settings(ball))], tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("processes", [1, 2])
@pytest.mark.parametrize("method", ["begin", "write"])
def test_a_full_disk_is_told_in_one_line_wherever_the_layers_are_written(
    ball: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: int, method: str
) -> None:
    """Also by a fork, whose error travels; nothing is left."""

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Scanlines, method, full)
    with pytest.raises(FitMaterialError, match=r"cannot write to .*no space left on device") as caught:
        run([(ball, settings(ball, fit=TWO))], tmp_path / "out", processes=processes)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_an_error_that_no_file_has_met_is_told_as_it_is(ball: Path, tmp_path: Path) -> None:
    """Whoever watches the progress may lose the line to a terminal: the folder has no part in that."""

    def progress(stage: str, _: float) -> None:
        if stage == "writing":
            raise BrokenPipeError("nobody watches")

    with pytest.raises(BrokenPipeError, match="nobody watches"):
        run([(ball, settings(ball))], tmp_path / "out", progress=progress)
    assert list(tmp_path.iterdir()) == []


def test_no_file_is_begun_after_all_was_given_up(ball: Path, tmp_path: Path) -> None:
    """A thread may still bring the layers."""
    report = fit_jointly([(ball, settings(ball))])
    assert report.layers is not None
    with pytest.raises(KeyboardInterrupt), writing(tmp_path / "out") as files:
        raise KeyboardInterrupt
    with pytest.raises(RuntimeError, match="given up"):
        files.layers(0, report.image, report.layers)
    assert list(tmp_path.iterdir()) == []
