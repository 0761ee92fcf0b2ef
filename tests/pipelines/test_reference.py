"""A grey card makes the scale absolute: truth of renders found back, its error in the albedo's, mistakes in a line.

The card is painted into the photograph by Lambert's law alone, E rho cos / pi; no code of the project has a part.
"""

from __future__ import annotations

import hashlib
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.cli import main
from pipelines.fit_material import fit_material
from pipelines.layers import Layer, resolve
from pipelines.locate import locate
from pipelines.report.result import result_object
from pipelines.settings import Settings
from synthetic.camera import Sensor
from synthetic.photograph import write_raw
from synthetic.render import render
from synthetic.scenes import exposed, scene_tables
from tests.inference.ball import NOISE, glossy, scene_of
from toolkit.errors import BadInputError
from toolkit.io.read import read_in_process
from toolkit.records import Reference

SIZE_PX, GREY, EXPOSURE = 360, 0.18, 0.05
LIGHT_COLOUR = np.array([2.0, 4.0, 3.0])
BOX = (12, 300, 40, 40)
ONE = {"models": ["torrance-sparrow"], "diffuse": ["lambert"], "ess": 500}


def coloured_scene() -> Any:
    """The usual ball under a light of unequal channels."""
    scene = scene_of(SIZE_PX)
    light = scene.lights[0].model_copy(update={"irradiance": tuple(LIGHT_COLOUR.tolist())})
    return type(scene)(camera=scene.camera, sphere=scene.sphere, lights=(light,), scale="absolute")


def raw_of(radiance: np.ndarray, seed: int) -> np.ndarray:
    """A mosaic of a whole picture (h, w, 3) in image units."""
    rng, sensor = np.random.default_rng(seed), Sensor()
    result = np.empty(radiance.shape[:2], np.uint16)
    for row, column, channel in sensor.channels:
        signal = radiance[row::2, column::2, channel]
        sd = np.sqrt(NOISE.gain[channel] * signal + NOISE.read[channel] ** 2)
        noisy = sensor.black_dn + (signal + sd * rng.standard_normal(signal.shape)) * (
            sensor.white_dn - sensor.black_dn
        )
        result[row::2, column::2] = np.rint(np.clip(noisy, 0, sensor.white_dn)).astype(np.uint16)
    return result


def card_radiance(normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Image units of a Lambertian card in this light."""
    cosine = float(np.array(coloured_scene().lights[0].direction) @ (np.array(normal) / np.linalg.norm(normal)))
    return EXPOSURE * LIGHT_COLOUR * GREY * cosine / np.pi


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ball.dng with a card in its corner, and card.dng, the card alone in the ball's place."""
    place = tmp_path_factory.mktemp("reference")
    scene = coloured_scene()
    picture = render(scene, glossy(), width_px=SIZE_PX, height_px=SIZE_PX, supersample=4)
    radiance = EXPOSURE * picture.radiance()
    x, y, width, height = BOX
    radiance[y - 4 : y + height + 4, x - 4 : x + width + 4] = card_radiance()
    write_raw(place / "ball.dng", raw_of(radiance, 1), NOISE, Sensor(), scene.camera)
    alone = np.full((SIZE_PX, SIZE_PX, 3), card_radiance((0.3, 0.2, 1.0)))
    write_raw(place / "card.dng", raw_of(alone, 2), NOISE, Sensor(), scene.camera)
    return place


def settings(**values: Any) -> Settings:
    """The scene without its irradiance, and a card."""
    tables = scene_tables(exposed(coloured_scene(), EXPOSURE), NOISE, irradiance=False)
    return resolve(None, flags=[Layer(name="scene.toml", values={**tables, "fit": ONE, **values})])


IN_FRAME = {"grey": GREY, "box_px": BOX, "grey_sd": 0.001, "normal_sd_deg": 0.5}


def test_a_card_in_the_frame_makes_albedos_absolute(folder: Path) -> None:
    """Irradiance and every colour within their errors of the truth; without the card the scale stays relative."""
    report = fit_material(folder / "ball.dng", settings(reference=IN_FRAME))
    assert report.scene.scale == "absolute"
    assert report.reference is not None
    z = (report.reference.irradiance - EXPOSURE * LIGHT_COLOUR) / report.reference.irradiance_sd
    assert np.abs(z).max() < 3
    found = result_object(report)
    assert found["reference"]["grey"] == [GREY] * 3
    parameters = found["fits"][0]["parameters"]
    for name, truth in glossy().colours.items():
        z = (np.array(parameters[name]["estimate"]) - truth) / parameters[name]["sd"]
        assert np.abs(z).max() < 4, name
    relative = result_object(fit_material(folder / "ball.dng", settings()))
    assert relative["scale"] == "relative"
    assert relative["reference"] is None


def test_the_cards_error_is_in_the_albedos(folder: Path) -> None:
    """An albedo is known no better than the card; intervals widen with it, and what noise alone leaves does not."""
    sds = {}
    for grey_sd in (0.0018, 0.018):
        told = {**IN_FRAME, "grey_sd": grey_sd, "normal_sd_deg": 0.0}
        found = result_object(fit_material(folder / "ball.dng", settings(reference=told, fit={**ONE, "ess": 4000})))
        sds[grey_sd] = albedo = found["fits"][0]["parameters"]["diffuse_albedo"]
        low, high = np.array(albedo["interval_90"])
        np.testing.assert_allclose((high - low) / (2 * 1.645 * np.array(albedo["sd"])), 1.0, rtol=0.1)
        strength = found["fits"][0]["parameters"]["specular_strength"]
        assert np.all(np.array(strength["sd"]) / strength["estimate"] > 0.9 * grey_sd / GREY)
    wide = np.array(sds[0.018]["sd"]) / sds[0.018]["estimate"]
    np.testing.assert_allclose(wide, 0.1, rtol=0.15)
    assert np.all(np.array(sds[0.0018]["sd"]) < 0.4 * np.array(sds[0.018]["sd"]))
    assert sds[0.0018]["sd_statistical"] == sds[0.018]["sd_statistical"]


def card_of(folder: Path, **told: Any) -> Reference:
    """What the card tells, without a fit."""
    path = folder / "ball.dng"
    found = locate(read_in_process(path), settings(reference=told), folder).reference
    assert found is not None
    return found


def test_a_card_in_a_photograph_of_its_own(folder: Path, tmp_path: Path) -> None:
    """A tilted card at another exposure: normal and EXIF are taken into account; without the normal it is off."""
    card = folder / "card.dng"
    told = {**IN_FRAME, "box_px": (100, 100, 160, 160), "file": "card.dng", "normal": (0.3, 0.2, 1.0)}
    found = card_of(folder, **told)
    assert np.abs((found.irradiance - EXPOSURE * LIGHT_COLOUR) / found.irradiance_sd).max() < 3
    assert found.sha256 == hashlib.sha256(card.read_bytes()).hexdigest()
    unturned = card_of(folder, **{**told, "normal": (0.0, 0.0, 1.0)})
    assert np.all(np.abs(unturned.irradiance / found.irradiance - 1) > 0.05)
    slower = tmp_path / "slower.dng"
    iso = struct.pack("<HHIHH", 34855, 3, 1, 100, 0)
    data = card.read_bytes()
    assert data.count(iso) == 1
    slower.write_bytes(data.replace(iso, struct.pack("<HHIHH", 34855, 3, 1, 50, 0)))
    doubled = card_of(folder, **{**told, "file": str(slower)})
    np.testing.assert_allclose(doubled.irradiance, 2 * found.irradiance)
    assert np.all(doubled.irradiance_sd / doubled.irradiance > found.irradiance_sd / found.irradiance)


@pytest.mark.parametrize(
    ("told", "line"),
    [
        ({"box_px": (340, 300, 40, 40)}, "leaves the 360 x 360 frame"),
        ({"box_px": (150, 150, 40, 40)}, "lies on the sphere"),
        ({"normal": (-1.0, -1.0, -0.5)}, "turned away from the light"),
        ({"box_px": (300, 4, 40, 40)}, "dark"),
        ({"file": "none.dng"}, "does not exist"),
    ],
)
def test_a_card_that_cannot_be_used_is_one_line(folder: Path, told: dict[str, Any], line: str) -> None:
    """Outside, on the ball, turned away, unlit, missing."""
    with pytest.raises(BadInputError, match=line) as caught:
        fit_material(folder / "ball.dng", settings(reference={**IN_FRAME, **told}))
    assert "\n" not in str(caught.value)


def test_the_scale_is_told_once(folder: Path) -> None:
    """Irradiance and card together contradict each other."""
    light = [{"kind": "directional", "direction": [0.3, 0.3, 0.9], "irradiance": [1, 1, 1]}]
    with pytest.raises(BadInputError, match="leave one of them out"):
        fit_material(folder / "ball.dng", settings(reference=IN_FRAME, light=light))


@pytest.mark.parametrize("text", ["0.18@1,2,3,4", "grey=0.18", "grey=x@1,2,3,4", "grey=0.18@1,2,3", "grey=1.8@1,2,9,9"])
def test_a_flag_that_makes_no_sense_is_usage(folder: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit 2 and one line that names the flag."""
    assert main([str(folder / "ball.dng"), "--reference", text]) == 2
    told = capsys.readouterr().err
    assert "--reference" in told
    assert told.count("\n") == 1
