"""Round trip: a ball rendered with each registered lobe and fitted with the same gives its numbers back.

Renders integrate over each pixel's area, fits look at sums over cells: the two share the lobe alone, which has oracles
of its own under tests/reflectance. 20 photographs of every lobe always, 200 and 1,000 in the slow tests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from tests.validation.lobes import Landing, at_the_optimum, by_posterior
from toolkit.reflectance import LOBES

Trial = Callable[[str, Sequence[int]], Landing]
TRIALS: dict[str, tuple[Trial, range]] = {
    "optimum, 200 photographs": (at_the_optimum, range(1, 201)),
    "posterior, 20 photographs": (by_posterior, range(1, 21)),
}


def _hold_to_their_errors(trial: Trial, seeds: Sequence[int]) -> None:
    """Every z within 5; over all lobes mean z^2 0.9 to 1.1 and coverage 84 to 96 %."""
    landings = {name: trial(name, seeds) for name in LOBES}
    for name, landing in landings.items():
        assert np.abs(landing.z).max() < 5.0, name
    z = np.concatenate([landing.z.ravel() for landing in landings.values()])
    held = np.concatenate([landing.held.ravel() for landing in landings.values()])
    assert 0.9 < np.mean(z**2) < 1.1
    assert 0.84 < held.mean() < 0.96
    assert not 0.9 < np.mean((1.25 * z) ** 2) < 1.1  # the control: sds a quarter too small would be noticed


def test_every_lobe_finds_itself() -> None:
    """Twenty photographs of each of all lobes: optimum and curvature."""
    _hold_to_their_errors(at_the_optimum, range(1, 21))


@pytest.mark.slow
@pytest.mark.parametrize("how", TRIALS)
def test_every_lobe_finds_itself_many_times(how: str) -> None:
    """Two hundred by optimum and curvature, twenty through posterior means, sds and intervals."""
    _hold_to_their_errors(*TRIALS[how])


@pytest.mark.slow
@pytest.mark.parametrize("name", LOBES)
def test_each_lobe_alone_states_its_errors_truly(name: str) -> None:
    """Of one lobe 1,000 photographs: with 200, whose numbers share their noise, mean z^2 errs by up to 0.09."""
    landing = at_the_optimum(name, range(1, 1001))
    assert np.abs(landing.z[:200]).max() < 5.0
    assert 0.9 < np.mean(landing.z**2) < 1.1
    assert 0.84 < landing.held.mean() < 0.96
