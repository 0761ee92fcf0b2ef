"""Which fits are begun and which are told, with fits that take no time."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from pipelines import candidates
from pipelines.candidates import fit_models
from pipelines.settings import FitTable, Settings
from pipelines.workers import workers
from toolkit.inference.model import Model

Pair = tuple[str, str]


@pytest.fixture
def begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where each fit writes its models, one a line; GGX is the best."""
    book = tmp_path / "begun"
    book.touch()

    def fake(_: object, model: Model, **__: object) -> SimpleNamespace:
        with book.open("a") as file:
            file.write(f"{model.specular.name} {model.diffuse.name}\n")
        return SimpleNamespace(
            model=model.specular.name, diffuse=model.diffuse.name, elpd=float(model.specular.name == "ggx")
        )

    monkeypatch.setattr(candidates, "infer_views", fake)
    return book


def last(name: str, book: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """This model over Lambert ends after another body was begun."""
    quick = candidates.infer_views

    def fake(views: Sequence[object], model: Model, **more: object) -> object:
        for _ in range(3000):
            if (model.specular.name, model.diffuse.name) != (name, "lambert") or "wolff" in book.read_text():
                return quick(views, model, **more)  # type: ignore[arg-type]  # as given
            time.sleep(0.01)
        raise TimeoutError("no other body was begun while a model was waited for")

    monkeypatch.setattr(candidates, "infer_views", fake)


def settings(*models: str, diffuse: Sequence[str] = ()) -> Settings:
    return Settings(fit=FitTable(models=models, diffuse=diffuse))


def told(of: Settings, processes: int) -> list[Pair]:
    with workers(processes) as crew:
        return [(fit.model, fit.diffuse) for fit in fit_models((), of, None, crew)]


WANTED = [("phong", "lambert"), ("ggx", "lambert"), ("ggx", "oren-nayar"), ("ggx", "wolff")]


@pytest.mark.parametrize(("slow", "wasted"), [("phong", []), ("ggx", [("phong", "wolff")])])
def test_a_wrong_guess_at_the_best_model_costs_one_fit(
    begun: Path, monkeypatch: pytest.MonkeyPatch, slow: str, wasted: list[Pair]
) -> None:
    """One core is idle while the last model is fitted, so one body is begun; the order told is always the same."""
    last(slow, begun, monkeypatch)
    assert told(settings("phong", "ggx"), 2) == WANTED
    assert sorted(tuple(line.split()) for line in begun.read_text().splitlines()) == sorted(WANTED + wasted)


def test_a_fit_over_a_wrong_guess_is_not_waited_for(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would go on in its fork, and hold up this process when that ends."""
    last("ggx", begun, monkeypatch)
    quick = candidates.infer_views

    def fake(views: Sequence[object], model: Model, **more: object) -> object:
        fit = quick(views, model, **more)  # type: ignore[arg-type]  # as given
        if (model.specular.name, model.diffuse.name) == ("phong", "wolff"):
            time.sleep(600.0)
        return fit

    monkeypatch.setattr(candidates, "infer_views", fake)
    before = set(multiprocessing.active_children())
    assert told(settings("phong", "ggx"), 2) == WANTED
    for child in set(multiprocessing.active_children()) - before:
        child.join(60.0)
        assert child.exitcode is not None


def test_one_by_one_nothing_is_fitted_in_vain(begun: Path) -> None:
    """A guess costs nothing where each fit begins as it is asked for."""
    assert told(settings("phong", "ggx"), 1) == WANTED
    assert len(begun.read_text().splitlines()) == len(WANTED)


def test_a_model_asked_for_twice_is_fitted_once(begun: Path) -> None:
    """Two equal rows would leave the data undecided between them."""
    twice = settings("ggx", "phong", "ggx", diffuse=("wolff", "wolff"))
    assert told(twice, 1) == [("ggx", "wolff"), ("phong", "wolff")]
    assert len(begun.read_text().splitlines()) == 2
