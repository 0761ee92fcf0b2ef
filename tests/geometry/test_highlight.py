"""The light read off the glossy ball itself: near enough to start a fit, and honest where it is not."""

from __future__ import annotations

import numpy as np
import pytest

from synthetic.materials import material
from synthetic.render import render
from tests.inference.ball import photograph, radiance_of, scene_of
from tests.realdata import folder
from toolkit.errors import BadInputError
from toolkit.flags import SampleFlag
from toolkit.geometry.highlight import LightFound, light_from_highlight
from toolkit.io.read import read_in_process
from toolkit.radiometry.linearise import linearise
from toolkit.radiometry.quads import quads
from toolkit.records import Camera, LinearImage, Sphere


def _found(image: LinearImage, sphere: Sphere) -> LightFound:
    picture = quads(image)
    return light_from_highlight(
        picture.values,
        sphere=sphere,
        camera=Camera(),
        origin_px=picture.origin_px,
        step_px=picture.step_px,
        flags=picture.flags,
    )


def _apart_deg(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    cosine = np.dot(a, b) / np.linalg.norm(a) / np.linalg.norm(b)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


@pytest.mark.parametrize("light_deg", [5.0, 40.0, 80.0])
def test_a_rendered_ball_tells_its_light(light_deg: float) -> None:
    """Within three of its stated sds, wherever the light stands; the highlight's normal would be off by half of it."""
    radiance, scene = radiance_of(300, light_deg=light_deg)
    found = _found(photograph(radiance, seed=1), scene.sphere)
    assert found.highlight_seen
    assert _apart_deg(found.direction, scene.lights[0].direction) < 3 * found.sd_deg


@pytest.mark.parametrize("index", [0, 9, 21, 33, 45])
def test_a_real_ball_tells_its_light(index: int) -> None:
    """Within 1.5 degrees of the calibrated direction, its highlight clipped; over all 48: median 0.6, greatest 1.1."""
    place = folder("diligent_ball")
    name = (place / "filenames.txt").read_text().split()[index]
    sphere = Sphere(centre_px=(307.87, 263.87), radius_px=70.75, covariance_px2=np.eye(3) * 0.1, source="given")
    image = linearise(read_in_process(place / name))
    assert any((plane.flags & SampleFlag.CLIPPED).any() for plane in image.planes)
    found = _found(image, sphere)
    truth = np.loadtxt(place / "light_directions.txt")[index]
    assert _apart_deg(found.direction, tuple(truth)) < 1.5


def test_a_matte_ball_is_told_with_a_wide_error() -> None:
    """Without a highlight the shading alone speaks, and the stated error is the wide one."""
    scene = scene_of(300)
    matte = material("ggx", {"alpha": 0.9, "diffuse_albedo": 0.5, "specular_f0": 0.0})
    radiance = render(scene, matte, width_px=300, height_px=300).radiance()
    found = _found(photograph(0.5 * radiance / radiance.max(), seed=1), scene.sphere)
    assert not found.highlight_seen
    assert found.sd_deg == pytest.approx(5.0)
    assert _apart_deg(found.direction, scene.lights[0].direction) < 5.0


def test_an_even_disc_tells_no_light() -> None:
    """A ball without shading, as in a light tent, is refused in one line."""
    radiance, scene = radiance_of(300)
    with pytest.raises(BadInputError, match="no light found"):
        _found(photograph(np.full_like(radiance, 0.3), seed=1), scene.sphere)
