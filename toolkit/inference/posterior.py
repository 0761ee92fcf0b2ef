"""Posterior draws: emcee walks in the shape alone, everything linear is drawn exactly given the shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.records import Diagnostics, Floats

from .diagnostics import autocorrelation_time, split_r_hat
from .problem import Optimum
from .proposal import Anywhere, GridProposal
from .solving import inverse
from .surrogate import Surrogate, surrogate_of

WALKERS = 128
CHAINS = 4  # groups of walkers, as the draws are stored
LENGTHS = 50  # autocorrelation times that a chain must last
MOST_STEPS = 20_000
MOST_R_HAT = 1.1  # of a chain to be believed
MOST_QUADRATURE_ERROR = 0.05  # sds
GRID = 2001  # places of the quadrature
MOST_TRIED = 8  # draws of the linear unknowns for one that is wanted
FIRST = 10  # steps that are thrown away
GUESSED_TAU = 1.2  # until the chain tells its own
ANYWHERE, EVOLVED, STRETCHED = 0.9, 0.07, 0.03  # shares of the moves

Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draws:
    """Joint posterior draws: shape coordinates (S, D) and linear unknowns (S, P), in order of their chains."""

    u: Floats
    x: Floats
    diagnostics: Diagnostics
    long_enough: bool
    truncation: float  # share of the draws that the parameters' range left over


def sample(
    optimum: Optimum, *, seed: int, effective: int = 4000, draws: int = 4000, progress: Progress | None = None
) -> Draws:
    """Sample the posterior around an optimum until `effective` samples and 50 autocorrelation times are there.

    The same seed gives the same draws. Where the linear unknowns have a range (an albedo of at least 0), draws outside
    it are left out: exact, since shape and linear unknowns are drawn jointly.
    """
    surrogate = surrogate_of(optimum)
    u: Floats
    x: Floats
    rng = np.random.default_rng(seed)
    if len(optimum.u) == 0:
        u, diagnostics, enough = np.zeros((draws, 0)), _independent(draws, seed), True
    else:
        u, diagnostics, enough = _walk(optimum, surrogate, seed=seed, rng=rng, effective=effective, progress=progress)
    u, x, kept = _draw_linear(optimum, surrogate, u, rng, draws)
    return Draws(u=u, x=x, diagnostics=diagnostics, long_enough=enough, truncation=kept)


def _independent(draws: int, seed: int) -> Diagnostics:
    return Diagnostics(samples=draws, ess_min=draws, r_hat_max=1.0, tau_max=1.0, acceptance=1.0, seed=seed)


def _walk(
    optimum: Optimum,
    surrogate: Surrogate,
    *,
    seed: int,
    rng: np.random.Generator,
    effective: int,
    progress: Progress | None,
) -> tuple[Floats, Diagnostics, bool]:
    import emcee

    from .ensemble import Ensemble

    dimensions = len(optimum.u)
    sampler = Ensemble(WALKERS, dimensions, surrogate.log_density, vectorize=True, moves=_moves(surrogate))
    begin = _around_mode(optimum, surrogate, rng)
    state = sampler.run_mcmc(emcee.State(begin, random_state=np.random.RandomState(seed).get_state()), FIRST)
    sampler.reset()
    tau, lengths = GUESSED_TAU, max(float(LENGTHS), effective / WALKERS)
    while sampler.iteration < min(wanted := lengths * tau, MOST_STEPS):
        done = sampler.iteration
        most = max(LENGTHS * GUESSED_TAU, done / 2)
        state = sampler.run_mcmc(state, int(np.ceil(min(wanted - done, most, MOST_STEPS - done))))
        tau = max(autocorrelation_time(sampler.get_chain()), 1.0)
        if progress is not None:
            progress("posterior", min(sampler.iteration / (lengths * tau), 1.0))
    chain = sampler.get_chain()
    flat = chain.transpose(1, 0, 2).reshape(-1, dimensions)
    diagnostics = Diagnostics(
        samples=len(flat),
        ess_min=len(flat) / tau,
        r_hat_max=max(split_r_hat(_groups(chain[:, :, d])) for d in range(dimensions)),
        tau_max=tau,
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        seed=seed,
        quadrature_error=_quadrature_error(surrogate, flat[:, 0]) if dimensions == 1 else None,
    )
    return flat, diagnostics, sampler.iteration >= lengths * tau and converged(diagnostics)


def _around_mode(optimum: Optimum, surrogate: Surrogate, rng: np.random.Generator) -> Floats:
    """Places for the walkers to begin at, spread by the mode's own sds, within the surrogate's box."""
    dimensions = len(optimum.u)
    sd = np.sqrt(np.maximum(np.diag(inverse(optimum.joint))[-dimensions:], 1e-24))
    inside = (surrogate.high - surrogate.low) * 0.01
    spread = optimum.u + sd * rng.standard_normal((WALKERS, dimensions))
    within = np.clip(spread, surrogate.low + inside, surrogate.high - inside)
    return np.asarray(within + 1e-3 * inside * rng.standard_normal(spread.shape))


def converged(found: Diagnostics) -> bool:
    """Whether chains agree with each other, and with the quadrature where there is one, to what chance allows."""
    allowed = max(MOST_QUADRATURE_ERROR, 5.0 / np.sqrt(found.ess_min))
    return found.r_hat_max < MOST_R_HAT and (found.quadrature_error or 0.0) < allowed


def _quadrature_error(surrogate: Surrogate, chain: Floats) -> float:
    """How far a single shape number's mean and sd are from those of the density summed over a grid, in sds."""
    grid = np.linspace(surrogate.low[0], surrogate.high[0], GRID)
    weight = np.exp((density := surrogate.log_density(grid[:, None])) - density.max())
    weight /= weight.sum()
    mean = float(weight @ grid)
    sd = float(np.sqrt(weight @ (grid - mean) ** 2))
    return max(abs(float(chain.mean()) - mean) / sd, abs(float(chain.std()) / sd - 1.0))


def _moves(surrogate: Surrogate) -> list[tuple[Any, float]]:
    """Proposals from the density on a grid, which forget where a walker stood; and differential evolution and
    stretches, to which that grid means nothing.
    """
    import emcee

    return [
        (Anywhere(GridProposal.of(surrogate), surrogate.log_density), ANYWHERE),
        (emcee.moves.DEMove(), EVOLVED),
        (emcee.moves.StretchMove(), STRETCHED),
    ]


def _groups(chain: Floats) -> Floats:
    """One parameter's chain (steps, walkers) as CHAINS chains of groups of walkers, each in order of time."""
    return chain.reshape(len(chain), CHAINS, -1).transpose(1, 0, 2).reshape(CHAINS, -1)


def _draw_linear(
    optimum: Optimum, surrogate: Surrogate, u: Floats, rng: np.random.Generator, draws: int
) -> tuple[Floats, Floats, float]:
    """Linear unknowns for shapes spread evenly over the chain; those outside their range are left out.

    Where few are inside, more are tried, several for a shape if there are not as many shapes.
    """
    prior = optimum.problem.prior
    stretch = 1
    while True:
        wanted = draws * min(stretch, MOST_TRIED)
        picked = u[np.linspace(0, len(u) - 1, wanted).round().astype(int)]
        x = surrogate.draws(picked, rng.standard_normal((wanted, len(prior.centre))))
        inside = np.all((x >= prior.low) & (x <= prior.high), axis=1)
        if inside.sum() >= draws or stretch >= MOST_TRIED:
            break
        stretch *= 4
    share = float(inside.mean())
    if inside.sum() < draws // 8:  # the optimum rests on bounds: what lies beyond them is moved onto them
        x, inside = np.clip(x, prior.low, prior.high), np.ones(len(x), bool)
    keep = np.flatnonzero(inside)
    keep = keep[np.linspace(0, len(keep) - 1, min(draws, len(keep) - len(keep) % CHAINS)).round().astype(int)]
    return picked[keep], x[keep], share
