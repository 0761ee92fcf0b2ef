"""From pixels to the surface: against ray tracing by brute force, and the kinds of light against their definitions."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.geometry.sphere import bounding_box, centre_position, on_sphere, surface
from toolkit.inference.moved_light import MovedLight
from toolkit.records import Camera, Scene, Sphere

ORTHOGRAPHIC = Camera()
PERSPECTIVE = Camera(projection="perspective", focal_length_px=700.0, principal_point_px=(320.0, 240.0))


def sphere_at(x: float, y: float, radius: float) -> Sphere:
    """A given sphere."""
    return Sphere(centre_px=(x, y), radius_px=radius, covariance_px2=np.eye(3) * 0.01, source="given")


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE])
def test_a_surface_point_projects_to_its_pixel(camera: Camera) -> None:
    """Points and normals lie on the unit sphere, face the camera, and project back to where they were seen."""
    sphere = sphere_at(420.0, 150.0, 90.0)
    y, x = np.mgrid[80:220:7, 350:490:7].reshape(2, -1).astype(float)
    seen = surface(camera, sphere, x, y)
    on = seen.on_sphere
    assert 0.3 < on.mean() < 1.0
    assert np.linalg.norm(seen.normal, axis=1) == pytest.approx(np.ones(len(x)))
    assert np.all(np.einsum("ni,ni->n", seen.normal, seen.view)[on] >= 0)
    if camera.projection == "orthographic":
        px, py = 420.0 + 90.0 * seen.normal[:, 0], 150.0 - 90.0 * seen.normal[:, 1]
    else:
        place = seen.normal + centre_position(camera, sphere)
        px, py = 320.0 - 700.0 * place[:, 0] / place[:, 2], 240.0 + 700.0 * place[:, 1] / place[:, 2]
    assert px[on] == pytest.approx(x[on], abs=1e-9)
    assert py[on] == pytest.approx(y[on], abs=1e-9)


def test_a_ray_hits_where_marching_along_it_does() -> None:
    """Perspective rays, marched in small steps, enter the sphere at the surface point found in closed form."""
    sphere = sphere_at(420.0, 150.0, 90.0)
    seen = surface(PERSPECTIVE, sphere, np.array([400.0, 450.0, 480.0]), np.array([120.0, 200.0, 160.0]))
    centre = centre_position(PERSPECTIVE, sphere)
    for normal, view in zip(seen.normal, seen.view, strict=True):
        along = np.linspace(0.0, 20.0, 400_001)
        inside = np.linalg.norm(-view * along[:, None] - centre, axis=1) < 1.0
        assert -view * along[np.argmax(inside)] - centre == pytest.approx(normal, abs=1e-3)


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE])
def test_the_box_holds_the_whole_outline(camera: Camera) -> None:
    """No pixel outside the bounding box sees the sphere, and the box is not the whole frame."""
    sphere = sphere_at(500.0, 300.0, 80.0)
    scene = Scene(camera=camera, sphere=sphere, lights=(DirectionalLight(direction=(0.0, 0.0, 1.0)),))
    x0, y0, x1, y1 = bounding_box(scene, 640, 480)
    seen = on_sphere(camera, sphere, *np.meshgrid(np.arange(640.0), np.arange(480.0)))
    outside = np.ones((480, 640), bool)
    outside[y0:y1, x0:x1] = False
    assert not seen[outside].any()
    assert seen.any()
    assert (x1 - x0) * (y1 - y0) < 0.25 * 640 * 480


def test_a_point_light_falls_off_with_the_squared_distance() -> None:
    """Irradiance at the centre is the stated one; nearer points get more, by the inverse square."""
    light = PointLight(position=(0.0, 0.0, 4.0), irradiance=(2.0, 1.0, 0.5))
    towards, irradiance = light.at(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 3.0, 0.0]]))
    assert irradiance[0] == pytest.approx([2.0, 1.0, 0.5])
    assert irradiance[1] == pytest.approx([8.0, 4.0, 2.0])
    assert irradiance[2] == pytest.approx(np.array([2.0, 1.0, 0.5]) * 16 / 25)
    assert towards[2] == pytest.approx([0.0, -0.6, 0.8])


def test_a_shifted_light_meets_both_kinds() -> None:
    """With no nearness it is the directional light, with a point's own nearness the point light."""
    points = np.random.default_rng(1).standard_normal((20, 3)) * 0.5
    place = np.array([1.0, 2.0, 5.0])
    distance = float(np.linalg.norm(place))
    x, y, z = place / distance
    rest = {"kind": "any", "direction": (x, y, z), "irradiance": (3.0, 2.0, 1.0), "angular_radius_deg": 0.0}
    for nearness, kind in (
        (0.0, DirectionalLight(direction=(x, y, z), irradiance=(3.0, 2.0, 1.0))),
        (1 / distance, PointLight(position=(1.0, 2.0, 5.0), irradiance=(3.0, 2.0, 1.0))),
    ):
        for ours, theirs in zip(MovedLight(nearness=nearness, **rest).at(points), kind.at(points), strict=True):
            assert ours == pytest.approx(np.broadcast_to(theirs, ours.shape))


@pytest.mark.parametrize(
    "make",
    [
        lambda: DirectionalLight(direction=(0.0, 0.0, 0.0)),
        lambda: DirectionalLight(direction=(0.0, float("nan"), 1.0)),
        lambda: DirectionalLight(direction=(0.0, 0.0, 1.0), irradiance=(0.0, 1.0, 1.0)),
        lambda: PointLight(position=(0.0, 0.5, 0.5)),
        lambda: PointLight(position=(0.0, 0.0, 3.0), colour=(1.0, 1.0, 1.0)),
    ],
)
def test_an_impossible_light_is_refused(make: object) -> None:
    """No direction, NaN, no irradiance, a lamp inside the ball, an unknown key."""
    with pytest.raises(ValidationError):
        make()
