"""A near lamp placed by two mirror balls; a far one left without a distance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.geometry.mirror_ball import photographed, traced
from toolkit.geometry.chrome import LampFound, lamp_in_ball
from toolkit.geometry.chrome_position import LampPlaced, place_lamp
from toolkit.records import Camera, Sphere

SIZE = (500, 1000)
MIDDLE = (499.5, 249.5)
FOCAL_PX = 2500.0
BALLS = [(-3.0, 0.0, -25.0), (3.0, 0.5, -26.0)]


def _perspective(lamp: Any, *, seed: int = 0, sd_px: float = 0.02, balls: Any = BALLS) -> list[LampFound]:
    camera = Camera(projection="perspective", focal_length_px=FOCAL_PX, principal_point_px=MIDDLE)
    signal = traced(balls, lamp, lamp_radius=np.linalg.norm(lamp) * 0.02, size=SIZE, focal_px=FOCAL_PX)
    image, found = photographed(0.8 * signal, seed=seed), []
    rng = np.random.default_rng(seed)
    for x, y, z in balls:
        centre = MIDDLE[0] + FOCAL_PX * x / -z, MIDDLE[1] - FOCAL_PX * y / -z
        radius = FOCAL_PX * np.tan(np.arcsin(1.0 / np.linalg.norm([x, y, z])))
        cx, cy, r = np.array([*centre, radius]) + sd_px * rng.standard_normal(3)
        sphere = Sphere(centre_px=(cx, cy), radius_px=r, covariance_px2=np.eye(3) * sd_px**2, source="given")
        found.append(lamp_in_ball(image, sphere=sphere, camera=camera))
    return found


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_two_balls_place_a_near_lamp(seed: int) -> None:
    """Position within 3.5 of its stated sds along each axis of its covariance, distance to a few percent."""
    lamp = np.array([9.0, 11.0, -8.0])
    placed = place_lamp(_perspective(lamp, seed=seed))
    off = np.array(placed.position) - (lamp - np.array(BALLS[0]))
    assert placed.near
    assert placed.same_lamp
    assert off @ np.linalg.solve(placed.position_covariance, off) < 16.3  # chi-square of 3, 99.9 %
    assert np.linalg.norm(off) < 0.06 * np.linalg.norm(lamp - np.array(BALLS[0]))


def test_an_orthographic_camera_places_it_too() -> None:
    """Balls side by side at one distance."""
    balls, lamp = [(-2.5, 0.0, 0.0), (2.5, 0.3, 0.0)], np.array([6.0, 8.0, 14.0])
    signal = traced(balls, lamp, lamp_radius=0.3, size=SIZE)
    image = photographed(0.8 * signal, seed=1)
    spheres = [
        Sphere(
            centre_px=(MIDDLE[0] + 100 * x, MIDDLE[1] - 100 * y),
            radius_px=100.0,
            covariance_px2=np.eye(3) * 0.02**2,
            source="given",
        )
        for x, y, _ in balls
    ]
    placed = place_lamp([lamp_in_ball(image, sphere=sphere, camera=Camera()) for sphere in spheres])
    assert np.linalg.norm(np.array(placed.position) - (lamp - np.array(balls[0]))) < 0.3


def test_a_far_lamp_gets_no_distance_but_a_least_one() -> None:
    """Direction within 3.5 sds, `near` False, and the truth beyond the least distance."""
    lamp = np.array([0.4, 0.5, 0.6]) * 1e5
    placed = place_lamp(_perspective(lamp, seed=4))
    assert not placed.near
    assert placed.least_distance > 20.0
    cosine = float(np.dot(placed.direction, lamp / np.linalg.norm(lamp)))
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 3.5 * placed.sd_deg * np.sqrt(2)


def test_two_lamps_are_not_taken_for_one() -> None:
    """Rays that cannot meet say so."""
    one = _perspective(np.array([9.0, 11.0, -8.0]))[0]
    other = _perspective(np.array([-11.0, -3.0, -5.0]))[1]
    placed: LampPlaced = place_lamp([one, other])
    assert not placed.same_lamp


def test_rays_that_part_towards_the_lamp_are_told() -> None:
    """They would meet behind the balls: no lamp, though they fit together; a far lamp's own rays do not part."""
    balls = [(-3.0, 0.0, -25.0), (3.0, 0.0, -25.0)]
    left, right = (np.add(ball, (side * 6.0, 5.0, 15.0)) for ball, side in zip(balls, (-1.0, 1.0), strict=True))
    placed = place_lamp([_perspective(left, balls=balls)[0], _perspective(right, balls=balls)[1]])
    assert placed.diverging
    assert not placed.near
    assert not place_lamp(_perspective(np.array([0.4, 0.5, 0.6]) * 1e5, seed=4)).diverging
