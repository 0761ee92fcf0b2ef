"""The main job as a whole: what it needs it finds, what it cannot use it refuses in one line, the same run repeats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.fit_material import fit_material
from pipelines.layers import Layer, resolve
from pipelines.report.result import result_object, result_text
from pipelines.settings import Settings
from synthetic.photograph import render_photograph
from tests.inference.ball import NOISE, glossy, scene_of
from tests.realdata import folder
from toolkit.errors import BadInputError

SIZE_PX = 360
ONE = {"models": ["torrance-sparrow"], "diffuse": ["lambert"], "ess": 500}


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A DNG of a glossy ball with its scene file beside it."""
    path = tmp_path_factory.mktemp("ball") / "ball.dng"
    render_photograph(
        scene_of(SIZE_PX),
        glossy(),
        NOISE,
        width_px=SIZE_PX,
        height_px=SIZE_PX,
        format="dng",
        exposure=None,
        seed=1,
        path=path,
    )
    return path


def settings(image: Path | None, **values: Any) -> Settings:
    """The sidecar's settings with others over them."""
    return resolve(image, flags=[Layer(name="--test", values={"fit": ONE, **values})])


def test_the_same_run_gives_the_same_bytes(ball: Path) -> None:
    """Two runs of one input, settings and seed give one JSON text, to the byte; another seed gives another."""
    texts = [result_text(result_object(fit_material(ball, settings(ball)))) for _ in range(2)]
    assert texts[0] == texts[1]
    other = settings(ball, fit={**ONE, "seed": 1})
    assert result_text(result_object(fit_material(ball, other))) != texts[0]


def test_one_process_or_several_give_the_same_result(ball: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The forks of the models change nothing, nor does a first guess at the best of them that comes out wrong."""
    several = settings(ball, fit={"models": ["phong", "torrance-sparrow"], "diffuse": [], "ess": 300})
    forked = fit_material(ball, several, processes=2)
    assert [(fit.model, fit.diffuse) for fit in forked.fits] == [
        ("phong", "lambert"),
        *(("torrance-sparrow", body) for body in ("lambert", "oren-nayar", "wolff")),
    ]
    monkeypatch.setenv("FIT_MATERIAL_ONE_PROCESS", "1")
    alone = fit_material(ball, several)
    assert result_text(result_object(alone)) == result_text(result_object(forked))


def test_what_is_not_given_is_found(ball: Path) -> None:
    """No sphere, no light: both are found, the flags say so, and the roughness is right all the same."""
    bare = settings(None, camera={"projection": "orthographic"})
    report = fit_material(ball, bare)
    assert report.scene.sphere.source == "detected"
    assert {"light_estimated", "relative_scale"} <= set(report.flags)
    roughness = next(e for e in report.fits[report.best].parameters if e.name == "roughness_rad")
    assert abs(float(roughness.estimate) - 0.12) < max(5 * float(roughness.sd), 0.002)


def test_the_model_that_made_it_is_preferred_by_default(ball: Path) -> None:
    """With nothing asked for, five lobes and then two more bodies are fitted; the true pair is preferred."""
    report = fit_material(ball, resolve(ball))
    assert len(report.fits) == 7
    best = report.fits[report.best]
    assert (best.model, best.diffuse, report.preferred) == ("torrance-sparrow", "lambert", report.best)
    assert report.flags == ()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"light": [{"kind": "directional", "direction": [0, 0, -1]}]}, "behind the sphere"),
        ({"sphere": {"centre_px": [180, 180], "radius_px": 5}}, "radius"),
        ({"sphere": {"centre_px": [2000, 180], "radius_px": 100}}, "outside"),
        (
            {
                "light": [{"kind": "directional", "direction": [1, 0, -0.9]}],
                "sphere": {"centre_px": [180, 180], "radius_px": 14},
            },
            "explains",
        ),
    ],
)
def test_an_impossible_scene_is_refused(ball: Path, values: dict[str, Any], line: str) -> None:
    """Light behind the ball, a ball too small or outside the frame, lit from elsewhere: one line each."""
    with pytest.raises(BadInputError, match=line) as caught:
        fit_material(ball, settings(ball, **values))
    assert "\n" not in str(caught.value)


def test_an_overexposed_ball_is_refused(tmp_path: Path) -> None:
    """Almost all clipped: shorten the exposure."""
    path = tmp_path / "bright.dng"
    render_photograph(
        scene_of(SIZE_PX),
        glossy(),
        NOISE,
        width_px=SIZE_PX,
        height_px=SIZE_PX,
        format="dng",
        exposure=400.0,
        seed=1,
        path=path,
    )
    with pytest.raises(BadInputError, match="clipped"):
        fit_material(path, settings(path))


@pytest.mark.parametrize("name", ["colorchart.dng", "Blackmagic.dng"])
def test_a_photograph_without_a_ball_has_none(name: str) -> None:
    """A colour chart and a street: no sphere found."""
    with pytest.raises(BadInputError, match="no sphere found"):
        fit_material(folder("raw") / name, settings(None))


def test_a_clipped_highlight_is_flagged(tmp_path: Path) -> None:
    """A highlight of five times saturation: flagged, and the strength still within its error."""
    path = tmp_path / "ball.dng"
    truth = render_photograph(
        scene_of(SIZE_PX),
        glossy(),
        NOISE,
        width_px=SIZE_PX,
        height_px=SIZE_PX,
        format="dng",
        exposure=None,
        highlight=1.6,
        seed=1,
        path=path,
    )
    report = fit_material(path, settings(path))
    assert "highlight_clipped" in report.flags
    strength = next(e for e in report.fits[0].parameters if e.name == "specular_strength")
    z = (strength.estimate - np.array(truth["parameters"]["specular_strength"])) / strength.sd
    assert np.abs(z).max() < 5
