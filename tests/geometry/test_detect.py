"""The ball is found in renders and in photographs, to within its stated error; where there is none, that is said."""

from __future__ import annotations

import numpy as np
import pytest

from tests.inference.ball import photograph, radiance_of
from tests.realdata import folder
from toolkit.errors import BadInputError
from toolkit.geometry.detect import Found, find_sphere
from toolkit.io.read import read_in_process
from toolkit.radiometry.linearise import linearise
from toolkit.radiometry.quads import quads
from toolkit.records import Camera, LinearImage


def _found(image: LinearImage, pick: tuple[float, float] | None = None) -> Found:
    picture = quads(image)
    return find_sphere(picture.values, origin_px=picture.origin_px, step_px=picture.step_px, camera=Camera(), pick=pick)


def _off(found: Found, x: float, y: float, radius: float) -> np.ndarray:
    return np.array([found.sphere.centre_px[0] - x, found.sphere.centre_px[1] - y, found.sphere.radius_px - radius])


@pytest.mark.parametrize("size_px", [240, 360])
@pytest.mark.parametrize("light_deg", [10.0, 35.0, 60.0])
def test_a_rendered_ball_is_found_within_its_error(size_px: int, light_deg: float) -> None:
    """Centre and radius lie within three of the stated sds, with part of the limb in the dark."""
    radiance, scene = radiance_of(size_px, light_deg=light_deg)
    found = _found(photograph(radiance, seed=0))
    off = _off(found, *scene.sphere.centre_px, scene.sphere.radius_px)
    assert np.all(np.abs(off) < 3 * np.sqrt(np.diag(found.sphere.covariance_px2)))


def test_a_picked_ball_is_the_one_around_the_place() -> None:
    """Of two balls each is found where it is picked."""
    large, _ = radiance_of(240)
    small, _ = radiance_of(120)
    both = np.zeros((240, 380, 3))
    both[:, :240], both[60:180, 255:375] = large, small
    image = photograph(both, seed=0)
    assert _found(image, pick=(120.0, 120.0)).sphere.radius_px == pytest.approx(0.42 * 240, abs=2.5)
    assert _found(image, pick=(315.0, 120.0)).sphere.radius_px == pytest.approx(0.42 * 120, abs=2.5)


def test_most_photographs_of_a_real_ball_are_found() -> None:
    """Of twelve lights on a glossy ball at least nine are found, each within three of its sds; the rest say so."""
    place = folder("diligent_ball")
    names, found = (place / "filenames.txt").read_text().split(), []
    for name in names[::4]:
        try:
            found.append(_found(linearise(read_in_process(place / name))))
        except BadInputError:
            continue
    assert len(found) >= 9
    for each in found:
        off = _off(each, 307.87, 263.87, 70.75)
        assert np.all(np.abs(off) < 3 * np.sqrt(np.diag(each.sphere.covariance_px2)))


@pytest.mark.parametrize("name", ["colorchart.dng", "Blackmagic.dng"])
def test_no_ball_is_found_where_there_is_none(name: str) -> None:
    """A colour chart and a street are refused in one line that says what to do."""
    with pytest.raises(BadInputError, match=r"no sphere found.*--sphere"):
        _found(linearise(read_in_process(folder("raw") / name)))


def test_noise_alone_is_no_ball() -> None:
    """Nor is an empty frame."""
    with pytest.raises(BadInputError, match="no sphere found"):
        _found(photograph(np.full((200, 200, 3), 0.1), seed=3))


def test_the_outline_of_a_perspective_sphere_is_its_cone_of_sight() -> None:
    """Places on the projected limb of a sphere, traced in three dimensions, lie on the fitted outline."""
    from toolkit.geometry.detect import _beyond

    f, centre = 800.0, np.array([1.4, -0.6, -6.0])
    towards = centre / np.linalg.norm(centre)
    across = np.cross(towards, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    up = np.cross(across, towards)
    angle = np.arcsin(1 / np.linalg.norm(centre))
    turns = np.linspace(0, 2 * np.pi, 50)
    rays = np.cos(angle) * towards + np.sin(angle) * (np.cos(turns)[:, None] * across + np.sin(turns)[:, None] * up)
    x, y = 320 - f * rays[:, 0] / rays[:, 2], 240 + f * rays[:, 1] / rays[:, 2]
    shape = np.array([320 - f * centre[0] / centre[2], 240 + f * centre[1] / centre[2], f * np.tan(angle)])
    camera = Camera(projection="perspective", focal_length_px=f, principal_point_px=(320.0, 240.0))
    assert np.abs(_beyond(shape, x, y, camera)).max() < 1e-6
