"""From surface to pixels: the way back of what `surface` and `mirrored` say."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.geometry.chrome import mirrored
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.geometry.project import limb_px, mirror_place, project
from toolkit.geometry.sphere import surface
from toolkit.records import Camera, Sphere

SPHERE = Sphere(centre_px=(700.0, 150.0), radius_px=90.0, covariance_px2=np.eye(3), source="given")
CAMERAS = [Camera(), Camera(projection="perspective", focal_length_px=800.0, principal_point_px=(399.5, 299.5))]


@pytest.mark.parametrize("camera", CAMERAS, ids=["orthographic", "perspective"])
def test_what_is_seen_at_a_pixel_projects_to_it(camera: Camera) -> None:
    """Over the whole disc, to a millionth of a pixel."""
    x, y = np.meshgrid(np.linspace(610.0, 800.0, 40), np.linspace(50.0, 250.0, 40))
    seen = surface(camera, SPHERE, x.ravel(), y.ravel())
    there = project(camera, SPHERE, seen.normal[seen.on_sphere])
    assert seen.on_sphere.sum() > 400
    np.testing.assert_allclose(there, np.stack([x.ravel(), y.ravel()], 1)[seen.on_sphere], atol=1e-6)


@pytest.mark.parametrize("camera", CAMERAS, ids=["orthographic", "perspective"])
def test_the_outline_is_where_sight_just_touches(camera: Camera) -> None:
    """There lines of sight pass the centre at one radius; a circle of the same radius has not, in perspective."""
    x, y = limb_px(camera, SPHERE).T
    np.testing.assert_allclose(surface(camera, SPHERE, x, y).offset2, 1.0, atol=1e-6)
    circle = np.hypot(x - SPHERE.centre_px[0], y - SPHERE.centre_px[1])
    assert (np.ptp(circle) > 1.0) == (camera.projection == "perspective")


@pytest.mark.parametrize("camera", CAMERAS, ids=["orthographic", "perspective"])
@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (0.5, 0.5, 0.7), (-0.9, 0.2, -0.3)])
def test_a_mirror_shows_the_light_at_the_mirror_place(camera: Camera, direction: tuple[float, float, float]) -> None:
    """Far and near lights: the direction mirrored there is the light's, from there."""
    for light in (DirectionalLight(direction=direction), PointLight(position=tuple(8.0 * c for c in direction))):
        normal = mirror_place(camera, SPHERE, light)
        assert normal is not None
        ((x, y),) = project(camera, SPHERE, normal[None])
        shown = mirrored(camera, SPHERE, np.array([x]), np.array([y]))[0]
        np.testing.assert_allclose(shown, light.at(normal[None])[0][0], atol=1e-6)


def test_a_light_straight_behind_is_mirrored_nowhere() -> None:
    """None, not a place on the limb."""
    assert mirror_place(Camera(), SPHERE, DirectionalLight(direction=(0.0, 0.0, -1.0))) is None
