"""The whole run: files are begun as soon as what they hold is there, and hold what they would have held at the end."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pipelines.colours
import toolkit.inference.compare
from pipelines.fit_material import fit_jointly
from pipelines.report.write import write_outputs, writing
from pipelines.run import run
from toolkit.errors import FitMaterialError
from toolkit.radiometry.quads import quads
from toolkit.records import Fit, ModelLayers

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


def test_layers_are_told_of_while_colours_are_still_separated(ball: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The separation waits here for the layers to be told: the other way round nobody would end."""
    told: list[tuple[int, ModelLayers]] = []
    heard, separate = threading.Event(), pipelines.colours.separate_colours

    def waiting(*args: Any, **more: Any) -> Any:
        assert heard.wait(LONG_S)
        return separate(*args, **more)

    def drawn(number: int, _: object, layers: ModelLayers) -> None:
        told.append((number, layers))
        heard.set()

    monkeypatch.setattr(pipelines.colours, "separate_colours", waiting)
    report = fit_jointly([(ball, settings(ball))], drawn=drawn)
    assert [(number, layers is report.layers) for number, layers in told] == [(0, True)]


@pytest.mark.parametrize("right", [True, False])
def test_layers_drawn_ahead_are_kept_only_if_they_are_of_the_best_fit(
    ball: Path, monkeypatch: pytest.MonkeyPatch, *, right: bool
) -> None:
    """While the last fit is out the likely best is drawn; where it is not the best in the end, that is drawn anew."""
    made: list[str] = []
    draw, rank = pipelines.colours.layers_of_fit, toolkit.inference.compare.rank

    def watched(image: Any, picture: Any, fit: Fit) -> ModelLayers:
        made.append(fit.model)
        return draw(image, picture, fit)

    def misled(fits: tuple[Fit, ...]) -> Any:
        best, *others = rank(fits)
        wanted = "torrance-sparrow" if right else "phong"
        first = next((i for i, fit in enumerate(fits) if fit.model == wanted), best)
        return (first if len(fits) < 4 else best, *others)

    monkeypatch.setattr(pipelines.colours, "layers_of_fit", watched)
    monkeypatch.setattr(toolkit.inference.compare, "rank", misled)
    asked = settings(ball, fit={**TWO, "diffuse": []})
    report = fit_jointly([(ball, asked)], processes=2)
    assert made == (["torrance-sparrow"] if right else ["phong", "torrance-sparrow"])
    assert report.layers is not None
    of_best = draw(report.image, quads(report.image), report.fits[report.best])
    assert np.array_equal(report.layers.specular, of_best.specular, equal_nan=True)


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
