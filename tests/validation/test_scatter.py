"""Answers scatter no more than they must: root mean squared error over the Cramér-Rao bound."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.validate.efficiency import efficiency, well_told
from pipelines.validate.verdict import MOST_MODEL_RATIO, MOST_RATIO
from tests.inference.ball import photograph
from tests.validation.scatter import BALLS, DRAWS, Ball, scattered
from toolkit.inference.fisher import bound_sds
from toolkit.inference.infer import gather_for
from toolkit.inference.problem import pose


@pytest.mark.parametrize("ball", BALLS[::4], ids=lambda ball: ball.name)
def test_the_stated_bound_is_the_bound(ball: Ball) -> None:
    """What `validate` and `plan` take for the bound is that of every sample and the renderer's own differences."""
    cells = gather_for(photograph(ball.radiance, seed=1, noise=ball.noise), ball.scene)
    problem = pose(ball.fitted, ball.scene, cells, ball.noise)
    stated = bound_sds(problem, {**ball.made.shape, **ball.made.colours}, ball.shifts)
    for name, least in ball.bound.items():
        assert np.all(np.abs(stated[name] / least - 1.02) < 0.03), name  # cells lose a little


@pytest.mark.slow
def test_scatter_is_near_the_least_possible() -> None:
    """24 materials x 200 draws: 1.05 of the bound for each parameter over all, 1.20 for each material."""
    lines = {ball.name: scattered(ball, range(DRAWS)) for ball in BALLS}
    every = [line for mine in lines.values() for line in mine]
    assert all(well_told(line) for line in every)
    for name in {number["name"] for line in every for number in line["numbers"]}:
        assert efficiency(every, name)[0] <= MOST_RATIO, name
    for name, mine in lines.items():
        assert efficiency(mine)[0] <= MOST_MODEL_RATIO, name
