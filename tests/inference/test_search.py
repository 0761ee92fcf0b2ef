"""Where a fit begins: many shapes looked at together, and no descent to where another led already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toolkit.inference import search
from toolkit.inference.descend import chi2_at
from toolkit.inference.gather import gather
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.problem import Optimum, pose
from toolkit.inference.settle import fit_with_shifts

from .ball import NOISE, photograph, radiance_of


def _settled(*, clipped: bool) -> Optimum:
    """A fit with its calibration, of a whole highlight or of one whose core is clipped."""
    radiance, scene = radiance_of(120)
    image = photograph(radiance, seed=1)
    cells = gather(image, scene)
    if clipped:
        brightest = tuple(replace(c, censored=c.means > 0.7 * c.means.max()) for c in cells.channels)
        cells = replace(cells, channels=(brightest[0], brightest[1], brightest[2]))
    return fit_with_shifts(pose(Model.named("ggx", "wolff"), scene, cells, NOISE), shifts_of(scene))[0]


@pytest.mark.parametrize("clipped", [False, True])
def test_many_shapes_are_worth_what_each_of_them_is(*, clipped: bool) -> None:
    """Chi-squares of shapes looked at together are those of each alone, with shifts and clipped data."""
    optimum = _settled(clipped=clipped)
    problem, weights = optimum.problem, optimum.weights
    assert optimum.problem.extras[0].size
    assert clipped == any(len(w.clipped) for w in weights.weights)
    shapes = optimum.u + np.array([[0.0, 0.0], [0.4, 0.02], [-0.4, 0.05], [0.1, -0.05]])
    each = [chi2_at(problem, problem.columns(u), weights) for u in shapes]
    assert search._chi2_sided(problem, shapes, weights) == pytest.approx(each, rel=1e-9)
    sides = search._chi2_of(problem, shapes, weights)  # as the weights have them, whatever the shape predicts
    assert (sides == pytest.approx(each, rel=1e-9)) == (not clipped)


def test_no_descent_is_made_to_where_another_led(monkeypatch: pytest.MonkeyPatch) -> None:
    """From every start it goes downhill to the first descent's end; never uphill, and from no end to another place."""
    problem, descents = search.thinned(_settled(clipped=False).problem), []
    refine = search.refine
    monkeypatch.setattr(search, "refine", lambda *a, **k: descents.append(refine(*a, **k)) or descents[-1])
    (found,) = search.search(problem)
    assert len(descents) == 1
    weights = search._provisional(problem)
    middles = problem.seen_in(view.middles() for view in problem.views)
    apart = 0.1 * np.subtract(*problem.model.bounds()[::-1])
    starts = search._starts(middles, weights, apart)
    assert len(starts) > 1
    assert all(search._leads_down(middles, start, found.u, weights) for start in starts[:3])
    assert not any(search._leads_down(middles, found.u, start, weights) for start in starts[:3])
    monkeypatch.setattr(search, "_leads_down", lambda *a: False)
    (alone,) = search.search(problem)
    assert len(descents) == 4
    assert np.abs(alone.u - found.u).max() < 1e-3
