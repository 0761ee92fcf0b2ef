"""How a chain is walked and judged: its proposals leave the density alone, its length is told as it is."""

from __future__ import annotations

import emcee
import numpy as np
import pytest

from toolkit.inference.diagnostics import autocorrelation_time
from toolkit.inference.proposal import CELLS, GridProposal
from toolkit.inference.surrogate import Surrogate
from toolkit.records import Floats

SD, CENTRE = 1.6, 0.7  # of the proposal, where the density is that of a normal deviate


def _parabola() -> Surrogate:
    """The log density of a normal deviate of SD about CENTRE, on a box of 8."""
    coefficients = np.polynomial.chebyshev.poly2cheb(
        np.array([-(CENTRE**2), 16 * CENTRE, -64.0]) / (2 * SD**2)  # -(8 t - CENTRE)^2 / (2 SD^2)
    )
    return Surrogate(
        low=np.array([-8.0]), high=np.array([8.0]), coefficients=coefficients[:, None], unknowns=0, error=0.0
    )


def _walk(proposal: GridProposal, *, corrected: bool) -> Floats:
    """A chain in one dimension of a normal density by that proposal alone, with Hastings' correction or without."""

    def propose(places: Floats, random: np.random.RandomState) -> tuple[Floats, Floats]:
        there, factor = proposal(places, random)
        return there, factor if corrected else np.zeros_like(factor)

    sampler = emcee.EnsembleSampler(
        64, 1, lambda u: -0.5 * u[:, 0] ** 2, vectorize=True, moves=emcee.moves.MHMove(propose)
    )
    random = np.random.RandomState(5)  # emcee's kind of generator
    sampler.run_mcmc(emcee.State(random.standard_normal((64, 1)), random_state=random.get_state()), 400)
    return np.asarray(sampler.get_chain(discard=20))


def test_a_proposal_of_another_density_leaves_the_chain_its_own() -> None:
    """Mean and sd are the density's within 4 sds of chance; those of the proposal without Hastings' factor."""
    chain, wrong = (_walk(GridProposal.of(_parabola()), corrected=corrected) for corrected in (True, False))
    chance = (autocorrelation_time(chain) / chain.size) ** 0.5
    assert abs(chain.mean()) < 4 * chance
    assert chain.std() == pytest.approx(1.0, abs=4 * chance)
    assert wrong.mean() > 20 * chance


def test_proposals_are_drawn_as_their_density_says() -> None:
    """Mean and sd of what is proposed are the grid's; the factor is its density at the old place over the new, log."""
    proposal, places = GridProposal.of(_parabola()), np.linspace(-7.9, 7.9, 20_000)[:, None]
    there, factor = proposal(places, np.random.RandomState(3))
    assert there.mean() == pytest.approx(CENTRE, abs=4 * SD / len(places) ** 0.5)
    assert there.std() == pytest.approx(SD, rel=4 / (2 * len(places)) ** 0.5)
    expected = ((there - CENTRE) ** 2 - (places - CENTRE) ** 2)[:, 0] / (2 * SD**2)
    steepest = 9.0 / SD**2 * 16.0 / CELLS[1]  # of the log density times a cell: half a cell off at either place
    assert np.abs(factor - expected).max() < steepest


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
