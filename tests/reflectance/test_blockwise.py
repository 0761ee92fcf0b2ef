"""Large arrays go through a lobe a block at a time, and come out as they would at once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import UP, around, shapes
from toolkit.reflectance import LOBES, Cosines
from toolkit.reflectance.blockwise import BLOCK, blockwise

LIGHT, VIEW = (v[:24_000] for v in around(12_000))
COSINES = Cosines.of(UP, LIGHT.reshape(4, -1, 3), VIEW.reshape(4, -1, 3))


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks that these directions are more than one of."""
    monkeypatch.setattr("toolkit.reflectance.blockwise.BLOCK", 8192)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("name", LOBES)
def test_blocks_change_nothing(name):
    """Value and gradient of one shape, and of several at once, are bit by bit what one call of the lobe gives."""
    lobe, points = LOBES[name], shapes(LOBES[name], (0.3, 0.7))
    several = tuple(np.array(column)[:, None, None] for column in zip(*points, strict=True))
    for shape in (points[0], several):
        np.testing.assert_array_equal(lobe.value(COSINES, shape), lobe.evaluate(COSINES, *shape, **lobe.complete(None)))
        whole = lobe.gradient(COSINES, *shape, **lobe.complete(None))
        for part, expected in zip(lobe.with_derivatives(COSINES, shape), whole, strict=True):
            np.testing.assert_array_equal(part, expected)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("whole", [(24_000,), (4, 6000), (6000, 4), (150, 160)])
def test_cosines_of_many_directions(whole):
    """Whatever shape the directions come in; each as it is by itself."""
    light, view = LIGHT.reshape(*whole, 3), VIEW.reshape(*whole, 3)
    many = Cosines.of(UP, light, view)
    for number in (0, 7, 12_345, 23_999):
        place = np.unravel_index(number, whole)
        alone = Cosines.of(UP, light[place], view[place])
        for field in ("n_dot_l", "n_dot_v", "l_dot_v", "n_dot_h", "l_dot_h", "sin2_h", "r_dot_v"):
            assert getattr(many, field)[place] == getattr(alone, field)


def test_what_is_the_same_everywhere_is_kept_once():
    """A far light and a far camera: their angle is one number, however many the normals."""
    cosines = Cosines.of(LIGHT, np.array([0.6, 0.0, 0.8]), UP)
    assert cosines.l_dot_h.shape == (24_000,)
    assert not any(cosines.l_dot_h.strides)
    assert any(cosines.n_dot_l.strides)


def test_a_block_is_no_larger_than_it_says():
    """Also of many rows, and where no row fits into a block."""
    for whole in ((200_000,), (3, 50_000), (50_000, 3), (2000, 1000), (5, 2, 100_000)):
        seen = []

        def of(piece, whole=whole, seen=seen):
            part = piece(np.broadcast_to(0.0, whole))
            seen.append(part.size)
            return (part + 1.0,)

        (made,) = blockwise(of, whole)
        assert made.shape == whole
        assert np.all(made == 1.0)
        assert max(seen) <= BLOCK
        assert len(seen) > 1
