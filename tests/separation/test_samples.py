"""The picture that separation starts from."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.separation.samples import local_mean


@pytest.mark.parametrize("apart", [(), (1,), (2,), (0, 2)])
def test_the_local_mean_is_of_each_channels_own_usable_samples(apart: tuple[int, ...]) -> None:
    """Also where channels lack other samples than the one before them; what is not usable may hold anything.

    Some lines at a time, with those around them.
    """
    rng = np.random.default_rng(0)
    values, good = rng.random((9, 8, 3)), np.repeat(rng.random((9, 8, 1)) < 0.8, 3, axis=2)
    for c in apart:
        good[..., c] = rng.random((9, 8)) < 0.6
    values[~good] = 1e9
    found = np.concatenate([local_mean(values, good, slice(*ends), radius=1) for ends in ((0, 1), (1, 6), (6, 9))])
    for row, column, c in np.ndindex(values.shape):
        near = slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2), c
        expected = values[near][good[near]].mean() if good[near].any() else 0.0
        assert found[row, column, c] == pytest.approx(expected, abs=1e-12)
