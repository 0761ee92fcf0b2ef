"""Scenes as written and as measured."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pipelines.settings import Settings, camera_of, lights_of, noise_of_settings, sphere_of
from synthetic.scenes import as_measured, direction, exposed, sphere_in, write_scene_toml
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.records import Noise

SUN = DirectionalLight(direction=direction(30.0, 50.0), direction_sd_deg=0.5, irradiance=(1.0, 2.0, 3.0))
LAMP = PointLight(position=(2.0, -1.0, 5.0), direction_sd_deg=0.5)


def test_directions_count_from_the_axis_and_from_the_right_upwards() -> None:
    """0 is towards the camera, 90 degrees around is up."""
    np.testing.assert_allclose(direction(0.0), (0, 0, 1), atol=1e-15)
    np.testing.assert_allclose(direction(90.0, 90.0), (0, 1, 0), atol=1e-15)
    np.testing.assert_allclose(direction(30.0), (0.5, 0, np.sqrt(0.75)), atol=1e-15)


def test_a_written_scene_is_read_back_identically(tmp_path: Path) -> None:
    """The pipeline's own settings accept the file and give the same records."""
    scene = sphere_in(300, 200, radius_px=70.0, lights=[SUN, LAMP], focal_length_px=2000.0, offset_px=(3.1, 4.2))
    noise = Noise(gain=np.full(3, 2e-4), read=np.array([1e-3, 2e-3, 3e-3]), source="given")
    write_scene_toml(tmp_path / "scene.toml", scene, noise, comment="two\nlines")
    settings = Settings.model_validate(tomllib.loads((tmp_path / "scene.toml").read_text()))
    sphere, read_noise = sphere_of(settings), noise_of_settings(settings)
    assert sphere is not None
    assert read_noise is not None
    assert lights_of(settings) == (SUN, LAMP)
    assert sphere.centre_px == scene.sphere.centre_px
    np.testing.assert_allclose(sphere.covariance_px2, scene.sphere.covariance_px2)
    np.testing.assert_array_equal(read_noise.read, noise.read)
    camera = camera_of(settings, width_px=300, height_px=200)
    assert (camera.focal_length_px, camera.principal_point_px) == (2000.0, (149.5, 99.5))


def test_a_scene_can_be_written_without_its_scale(tmp_path: Path) -> None:
    """Leaving out the irradiance leaves the scale unknown."""
    write_scene_toml(tmp_path / "scene.toml", sphere_in(300, 200, radius_px=70.0, lights=[SUN]), irradiance=False)
    assert "irradiance" not in (tmp_path / "scene.toml").read_text()


def test_exposure_scales_every_light_and_makes_the_scale_known() -> None:
    """A light of unknown irradiance counts as 1 before the exposure."""
    scene = exposed(sphere_in(300, 200, radius_px=70.0, lights=[SUN, LAMP]), 2.0)
    assert [light.irradiance for light in scene.lights] == [(2.0, 4.0, 6.0), (2.0, 2.0, 2.0)]
    assert scene.scale == "absolute"


@pytest.mark.parametrize("light", [SUN, LAMP])
def test_a_measured_scene_errs_by_its_own_sds(light: DirectionalLight | PointLight) -> None:
    """Over 2,000 draws sphere and light scatter around the truth as they say, in both directions across."""
    scene, rng = sphere_in(300, 200, radius_px=70.0, lights=[light], radius_sd_px=0.3), np.random.default_rng(2)
    drawn = [as_measured(scene, rng) for _ in range(2000)]
    shifts = np.array([[*s.sphere.centre_px, s.sphere.radius_px] for s in drawn]) - [149.5, 99.5, 70.0]
    angles = np.array([s.lights[0].direction for s in drawn]) - light.direction
    np.testing.assert_allclose(shifts.std(axis=0), [0.1, 0.1, 0.3], rtol=0.05)
    np.testing.assert_allclose(shifts.mean(axis=0), 0.0, atol=0.02)
    assert np.sqrt((angles**2).sum(axis=1).mean() / 2) == pytest.approx(np.radians(0.5), rel=0.05)
    lengths = [np.linalg.norm(s.lights[0].position) for s in drawn if isinstance(s.lights[0], PointLight)]
    np.testing.assert_allclose(lengths, np.sqrt(30.0))
