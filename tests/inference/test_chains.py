"""How a chain is walked and judged: its proposals leave the density alone, its length is told as it is."""

from __future__ import annotations

from dataclasses import replace

import emcee
import numpy as np
import pytest

from toolkit.inference.diagnostics import autocorrelation_time
from toolkit.inference.ensemble import Ensemble
from toolkit.inference.proposal import Anywhere, GridProposal
from toolkit.inference.surrogate import Surrogate
from toolkit.records import Floats

SD, CENTRE = 1.6, 0.7  # of the proposal, where the density is that of a normal deviate


def _parabola() -> Surrogate:
    """The log density of a normal deviate of SD about CENTRE, on a box of 8."""
    coefficients = np.polynomial.chebyshev.poly2cheb(
        np.array([-(CENTRE**2), 16 * CENTRE, -64.0]) / (2 * SD**2)  # -(8 t - CENTRE)^2 / (2 SD^2)
    )
    return _of_shapes_alone(np.array([-8.0]), np.array([8.0]), coefficients)


def _of_shapes_alone(low: Floats, high: Floats, density: Floats) -> Surrogate:
    """Without linear unknowns."""
    none = np.zeros((*density.shape, 0))
    return Surrogate(low=low, high=high, density=density, mean=none, factor=none[..., None], error=0.0)


def _normal(u: Floats) -> Floats:
    return np.asarray(-0.5 * u[:, 0] ** 2)


def _walk(move: Anywhere) -> Floats:
    """A chain in one dimension of a normal density by that move alone."""
    sampler = emcee.EnsembleSampler(64, 1, _normal, vectorize=True, moves=move)
    random = np.random.RandomState(5)  # emcee's kind of generator
    sampler.run_mcmc(emcee.State(random.standard_normal((64, 1)), random_state=random.get_state()), 400)
    return np.asarray(sampler.get_chain(discard=20))


def test_a_proposal_of_another_density_leaves_the_chain_its_own() -> None:
    """Mean and sd are the density's within 4 sds of chance; those of the proposal without Hastings' factor."""
    grid = GridProposal.of(_parabola())
    flat = replace(grid, height=np.ones_like(grid.height))  # draws the same, as if all places were equally likely
    chain, wrong = _walk(Anywhere(grid, _normal)), _walk(Anywhere(flat, _normal))
    chance = (autocorrelation_time(chain) / chain.size) ** 0.5
    assert abs(chain.mean()) < 4 * chance
    assert chain.std() == pytest.approx(1.0, abs=4 * chance)
    assert wrong.mean() > 20 * chance


def test_proposals_are_drawn_as_their_density_says() -> None:
    """Mean and sd of what is proposed are the density's, and so is the density that it is told to have."""
    grid = GridProposal.of(_parabola())
    places = grid.draw(20_000, np.random.RandomState(3))
    assert places.mean() == pytest.approx(CENTRE, abs=4 * SD / len(places) ** 0.5)
    assert places.std() == pytest.approx(SD, rel=4 / (2 * len(places)) ** 0.5)
    told = grid.log_density(places)
    expected = -((places[:, 0] - CENTRE) ** 2) / (2 * SD**2)
    away = told - told.max() - expected + expected.max()
    assert np.abs(away).max() < 0.01


def test_proposals_reach_to_the_ends_of_the_box_and_no_further() -> None:
    """Of a density that is even over a square each strip along its edge holds what it should, to 4 sds of chance."""
    flat = _of_shapes_alone(np.array([-1.0, 2.0]), np.array([1.0, 2.5]), np.zeros((1, 1)))
    places = GridProposal.of(flat).draw(40_000, np.random.RandomState(8))
    share = (places - flat.low) / (flat.high - flat.low)
    assert share.min() >= 0.0
    assert share.max() <= 1.0
    for end in (share, 1.0 - share):
        for strip in (0.004, 0.05):
            chance = (strip / len(share)) ** 0.5
            assert np.mean(end < strip, axis=0) == pytest.approx([strip, strip], abs=4 * chance)


def test_walkers_are_walked_as_emcee_walks_them() -> None:
    """The sampler that leaves out what emcee does to every number leads to the same bytes."""
    chains = []
    for kind in (emcee.EnsembleSampler, Ensemble):
        sampler = kind(64, 1, _normal, vectorize=True)
        random = np.random.RandomState(5)
        state = sampler.run_mcmc(emcee.State(random.standard_normal((64, 1)), random_state=random.get_state()), 20)
        sampler.run_mcmc(state, 20)
        chains.append(sampler.get_chain())
    assert np.array_equal(*chains)


@pytest.mark.parametrize("persistence", [0.0, 0.3, 0.8])
def test_the_autocorrelation_time_of_a_short_chain_is_not_told_too_short(persistence: float) -> None:
    """Over 50 of them, within 10 % of an autoregression's (1 + a) / (1 - a), where emcee's own falls short."""
    true = (1 + persistence) / (1 - persistence)
    steps, rng = round(50 * true), np.random.default_rng(6)
    chain = np.empty((steps, 128, 1))
    chain[0] = rng.standard_normal((128, 1))
    for t in range(1, steps):
        chain[t] = persistence * chain[t - 1] + (1 - persistence**2) ** 0.5 * rng.standard_normal((128, 1))
    assert autocorrelation_time(chain) == pytest.approx(true, rel=0.1)
    assert emcee.autocorr.integrated_time(chain, tol=0)[0] < 0.9 * true


def test_walkers_that_stand_still_have_no_short_autocorrelation_time() -> None:
    """Each shaking about its own place: the time is that of the whole chain, not that of the shaking."""
    rng = np.random.default_rng(7)
    chain = rng.standard_normal((1, 128, 1)) + 0.3 * rng.standard_normal((100, 128, 1))
    assert autocorrelation_time(chain) > 25
    assert emcee.autocorr.integrated_time(chain, tol=0)[0] < 2
