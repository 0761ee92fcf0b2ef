"""plan: what it promises before the photograph is what a fit of it then states, and where F0 is to be had."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.cli import main
from pipelines.plan import Setup, _lit_from, _sds, _view, plan
from synthetic.camera import exposure_for
from synthetic.materials import material
from synthetic.render import render
from synthetic.scenes import direction, exposed
from tests.inference.ball import BODY, NOISE, glossy, photograph, replace_light, scene_of
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.reflectance.fresnel import dielectric_f0

SIZE_PX = 160
GLASS = material("ggx", {"alpha": 0.15, "diffuse_albedo": BODY, "specular_index": 1.5})


def setup(light_deg: float = 35.0, *, scale: str = "absolute", **more: object) -> Setup:
    """A ball to be photographed; its light and outline known no better than a fit is told."""
    asked = {"material": glossy(), "noise": NOISE, "format": "dng", "exposure": None} | more
    scene = scene_of(SIZE_PX, light_deg=light_deg, scale=scale)
    return Setup(scene=scene, width_px=SIZE_PX, height_px=SIZE_PX, **asked)  # type: ignore[arg-type]  # as a table


def test_what_is_promised_is_what_a_fit_states() -> None:
    """The sds of a posterior of the very photograph agree with the bound, number by number."""
    asked = setup()
    promised = _sds(Model.named("torrance-sparrow"), [_view(asked, *_told(asked), asked.scene)], _told(asked)[1], ())
    picture = render(asked.scene, asked.material, width_px=SIZE_PX, height_px=SIZE_PX)
    factor = exposure_for(picture, highlight=0.8)
    told, image = exposed(asked.scene, factor), photograph(picture.radiance() * factor, seed=1)
    fit = infer(image, told, gather_for(image, told), Model.named("torrance-sparrow"), seed=1, discrepancy=False)
    stated = {one.name: np.atleast_1d(one.sd) for one in fit.parameters}
    assert set(promised) == {"roughness_rad", "diffuse_albedo", "specular_f0"}
    for name, sd in promised.items():
        np.testing.assert_allclose(stated[name], sd, rtol=0.1, err_msg=name)


def _told(asked: Setup) -> tuple[Model, dict[str, np.ndarray]]:
    numbers = {"roughness_rad": np.array([0.12]), "diffuse_albedo": np.array(BODY), "specular_f0": np.full(3, 0.04)}
    return Model.named("torrance-sparrow"), numbers


def test_another_photograph_never_tells_less_where_the_irradiance_errs() -> None:
    """An irradiance known to 5 % is that in one photograph's promise, too, and the noise alone is told without it."""
    asked = setup()
    asked = replace(asked, scene=replace_light(asked.scene, irradiance_relative_sd=0.05))
    shot, truth = _view(asked, *_told(asked), asked.scene), _told(asked)[1]
    model = Model.named("torrance-sparrow")
    one, two, noise = (
        _sds(model, *of) for of in (([shot], truth, ()), ([shot] * 2, truth, ()), ([shot], truth, ("all",)))
    )
    albedo = np.asarray(BODY)
    np.testing.assert_allclose(one["diffuse_albedo"] / albedo, 0.05, rtol=0.05)
    np.testing.assert_allclose(two["diffuse_albedo"] / albedo, 0.05 / np.sqrt(2.0), rtol=0.05)
    assert max(noise["diffuse_albedo"] / albedo) < 0.005


def test_only_another_angle_to_the_view_tells_f0() -> None:
    """Lights at 20 and 120 degrees tell F0 best, then 20 and 100, then -20 and 80; -50 and 50 not at all."""
    found = {}
    truth = {"alpha": np.array([0.15]), "diffuse_albedo": np.array(BODY), "specular_f0": dielectric_f0(np.full(3, 1.5))}
    model = Model.named("ggx", "lambert", {"fresnel": "dielectric"})
    for one, other in ((20.0, 120.0), (20.0, 100.0), (-20.0, 80.0), (-50.0, 50.0)):
        asked = setup(one, scale="relative", material=GLASS)
        scenes = [_lit_from(asked.scene, direction(off, 20.0)) for off in (one, other)]
        views = [_view(asked, model, truth, scene) for scene in scenes]
        sds = _sds(model, views, truth, ())
        found[one, other] = float(np.mean(sds["specular_f0"])) / 0.04 if "specular_f0" in sds else np.inf
    assert list(found.values()) == sorted(found.values())
    assert found[20.0, 120.0] < 0.02
    assert found[-20.0, 80.0] > 3 * found[20.0, 120.0]
    assert not np.isfinite(found[-50.0, 50.0])


def test_the_best_second_light_is_found() -> None:
    """For a clear coat of unknown scale it stands far off the axis; the same photograph again does not tell F0."""
    found = plan(setup(20.0, scale="relative", material=GLASS))
    assert "specular_f0" not in found.sds
    assert "specular_f0" not in found.repeated.sds
    assert found.seconds[0].off_axis_deg >= 100.0
    assert found.seconds[0].gain > found.repeated.gain + 0.5
    assert np.all(found.seconds[0].sds["specular_f0"] < 0.002)
    assert np.all(found.noise_sds["alpha"] <= found.sds["alpha"])


def test_a_clipped_highlight_is_known_to_tell_less() -> None:
    """Twice the exposure that saturates the highlight's core costs precision, although the noise is relatively less."""
    good = setup()
    brightest = 0.8 / exposure_for(render(good.scene, good.material, width_px=80, height_px=80), highlight=0.8)
    sds = [
        _sds(_told(one)[0], [_view(one, *_told(one), one.scene)], _told(one)[1], ())["roughness_rad"]
        for one in (replace(good, exposure=0.8 / brightest), replace(good, exposure=3.0 / brightest))
    ]
    assert sds[1] > 1.3 * sds[0]


SCENE = """
[image]
width_px = 120
height_px = 120
[sphere]
centre_px = [60, 60]
radius_px = 50
[[light]]
kind = "directional"
direction = [0.3, 0.2, 0.9]
[material]
model = "ggx"
[material.parameters]
alpha = 0.2
diffuse_albedo = 0.4
specular_index = 1.5
"""


def test_the_command_tells_it_in_words_and_as_an_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table with the best second lights; with --json every one of them."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    assert main(["plan", str(scene)]) == 0
    told = capsys.readouterr().out
    assert "specular_f0" in told
    assert "not identified" in told
    assert "the same photograph once more" in told
    assert all(len(line) <= 100 and line == line.rstrip() for line in told.splitlines())
    assert main(["plan", str(scene), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "fit-material/plan/1"
    assert found["parameters"]["specular_f0"] == {
        "value": pytest.approx([0.04] * 3),
        "sd": None,
        "sd_statistical": None,
    }
    assert len(found["second"]) == 36
    assert found["second"][0]["gain"] >= found["second"][-1]["gain"]


def test_a_scene_without_a_material_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line that names what lacks."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.split("[material]")[0])
    assert main(["plan", str(scene)]) == 3
    assert "the scene lacks [material]" in capsys.readouterr().err
