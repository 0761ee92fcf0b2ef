"""The posterior: emcee's answer is quadrature's, the same seed gives the same draws, bounds hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebvander

from toolkit.inference.diagnostics import split_r_hat
from toolkit.inference.discrepancy import stretched
from toolkit.inference.fit import fit
from toolkit.inference.gather import gather
from toolkit.inference.model import Model
from toolkit.inference.posterior import converged, sample
from toolkit.inference.problem import Optimum, pose
from toolkit.inference.proposal import POINTS
from toolkit.inference.surrogate import (
    DEPTH,
    NODES,
    REACH_SD,
    TOLERANCE,
    _along_axes,
    _error_of_lower,
    _exact,
    _places,
    surrogate_of,
)
from toolkit.records import Floats, Noise
from toolkit.reflectance import LOBES

from .ball import NOISE, photograph, radiance_of


def _optimum(noise: Noise = NOISE, model: str = "torrance-sparrow", diffuse: str = "lambert") -> Optimum:
    radiance, scene = radiance_of(200)
    image = photograph(radiance, seed=1, noise=noise)
    return fit(pose(Model.named(model, diffuse), scene, gather(image, scene), noise))


@pytest.fixture(scope="module")
def optimum() -> Optimum:
    """A fit of one roughness."""
    return _optimum()


def test_emcee_agrees_with_quadrature(optimum: Optimum) -> None:
    """Mean within 0.05 sd and sd within 3 % of the integral over the one shape number, with 5,000 effective samples."""
    draws = sample(optimum, seed=3, effective=6000, draws=8000)
    mean, sd = _quadrature(optimum)
    assert draws.diagnostics.ess_min >= 5000
    assert abs(draws.u.mean() - mean) < 0.05 * sd
    assert draws.u.std() == pytest.approx(sd, rel=0.03)
    assert draws.diagnostics.r_hat_max < 1.02
    assert draws.diagnostics.quadrature_error is not None
    assert draws.diagnostics.quadrature_error < 0.05
    assert draws.long_enough


def test_a_chain_at_odds_is_not_silent(optimum: Optimum) -> None:
    """A chain whose parts disagree, or that stands beside the quadrature's answer, does not count as converged."""
    good = sample(optimum, seed=3, effective=1000).diagnostics
    assert converged(good)
    assert not converged(replace(good, r_hat_max=1.3))
    assert not converged(replace(good, quadrature_error=0.5))
    assert converged(replace(good, ess_min=100.0, quadrature_error=0.2))  # no more than chance allows


@pytest.mark.parametrize(("correlation", "bend"), [(0.8, 0.1), (0.8, 0.3), (0.95, 0.3)])
def test_a_bent_ridge_askew_in_its_box_is_not_believed(correlation: float, bend: float) -> None:
    """Of the coarsest grid's 49 points three or fewer lie where such a density counts; it is off by far between them.

    The control: the same ridge straight is told to the last digit.
    """
    wide, narrow = np.sqrt(1.0 + correlation), np.sqrt(1.0 - correlation)

    def density(x: Floats, y: Floats, bend: float) -> Floats:
        along, across = (x + y) / (np.sqrt(2.0) * wide), (x - y) / (np.sqrt(2.0) * narrow)
        return -0.5 * along**2 - 0.5 * (across - bend * along**2 / (1.0 + 0.3 * along**2)) ** 2

    nodes = NODES[2][0]
    at, fine = REACH_SD * _places(nodes), np.linspace(-REACH_SD, REACH_SD, 81)
    back = np.linalg.inv(chebvander(_places(nodes), nodes - 1))
    for bent in (bend, 0.0):
        coefficients = _along_axes(density(at[:, None], at, bent)[..., None], back)
        told = _along_axes(coefficients, chebvander(fine / REACH_SD, nodes - 1))[..., 0]
        true = density(fine[:, None], fine, bent)
        off = np.abs(told - true)[true > -DEPTH].max()
        assert (off > 10 * TOLERANCE) == (_error_of_lower(coefficients) > TOLERANCE) == (bent > 0.0)


def test_the_surrogate_is_the_exact_density(optimum: Optimum) -> None:
    """Within its reach the interpolated log density is the exact one."""
    surrogate = surrogate_of(optimum)
    for u in np.linspace(surrogate.low, surrogate.high, 11)[2:-2]:
        density, mean, _ = _exact(optimum, u)
        assert surrogate.log_density(u[None])[0] == pytest.approx(density, abs=0.02)
        assert surrogate.conditional(u[None])[0][0] == pytest.approx(mean, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize(("model", "diffuse"), [("ggx", "oren-nayar"), ("beckmann", "wolff"), ("gtr", "lambert")])
def test_two_shape_numbers_are_solved_for_as_each_shape_alone_is(model: str, diffuse: str) -> None:
    """On the grid, where lobes are shared, densities and means are those of every shape's own normal equations."""
    found = _optimum(model=model, diffuse=diffuse)
    surrogate = surrogate_of(found)
    inside = np.random.default_rng(4).uniform(0.3, 0.7, (12, 2))
    for u in surrogate.low + inside * (surrogate.high - surrogate.low):
        density, mean, precision = _exact(found, u)
        means, factors = surrogate.conditional(u[None])
        assert surrogate.log_density(u[None])[0] == pytest.approx(density, abs=0.02)
        assert means[0] == pytest.approx(mean, rel=1e-3, abs=1e-6)
        assert factors[0] @ factors[0].T == pytest.approx(np.linalg.inv(precision), rel=1e-2, abs=1e-9)


def test_the_same_seed_gives_the_same_draws(optimum: Optimum) -> None:
    """Draws depend on the seed alone."""
    first, again, other = (sample(optimum, seed=s, effective=500, draws=400) for s in (7, 7, 8))
    assert np.array_equal(first.u, again.u)
    assert np.array_equal(first.x, again.x)
    assert not np.array_equal(first.u, other.u)


def test_draws_of_the_linear_numbers_have_the_joint_covariance(optimum: Optimum) -> None:
    """Shape and colours are drawn jointly: their spread is that of the inverse of the joint normal matrix."""
    draws = sample(optimum, seed=4, effective=4000, draws=4000)
    joint = np.hstack([draws.x, draws.u])
    expected = np.sqrt(np.diag(np.linalg.inv(optimum.joint)))
    assert joint.std(axis=0) == pytest.approx(expected, rel=0.08)


def test_no_draw_leaves_its_range() -> None:
    """With noise as large as the signal the albedos near zero stay at least zero, F0 at most one."""
    loud = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1.0), source="given")
    draws = sample(_optimum(loud), seed=1, effective=500, draws=1000)
    names = [name for name, _ in _optimum(loud).problem.layout.names]
    for i, name in enumerate(names):
        if name != "pedestal":
            assert draws.x[:, i].min() >= 0.0
        if name == "specular_f0":
            assert draws.x[:, i].max() <= 1.0


def test_stretching_widens_draws_and_leaves_their_mean(optimum: Optimum) -> None:
    """Also where the mean lies five sds beside the mode: stretched about the mode it would end fifteen beside."""
    draws = sample(optimum, seed=3, effective=1000)
    aside = replace(draws, u=draws.u + 5.0 * draws.u.std())
    found = stretched(optimum, aside, 3.0 * np.eye(len(optimum.joint)))
    assert found.u.mean() == pytest.approx(aside.u.mean(), abs=1e-9)
    assert found.u.std() == pytest.approx(3.0 * draws.u.std())
    assert np.std(found.x, axis=0) == pytest.approx(3.0 * np.std(draws.x, axis=0))


def test_split_r_hat_tells_chains_that_disagree() -> None:
    """Near 1 for chains of one distribution, far above it where one chain stands elsewhere or all of them drift."""
    rng = np.random.default_rng(2)
    chains = rng.standard_normal((4, 1000))
    assert split_r_hat(chains) < 1.01
    assert split_r_hat(chains + np.array([0, 0, 0, 2])[:, None]) > 1.2
    assert split_r_hat(chains + np.linspace(0, 3, 1000)) > 1.2


def _quadrature(optimum: Optimum) -> tuple[float, float]:
    sd = float(np.sqrt(np.linalg.inv(optimum.joint)[-1, -1]))
    u: Floats = optimum.u[0] + sd * np.linspace(-6, 6, 121)
    weight = np.exp([_exact(optimum, np.array([v]))[0] for v in u])
    mean = float(weight @ u / weight.sum())
    return mean, float(np.sqrt(weight @ (u - mean) ** 2 / weight.sum()))


def test_every_pair_of_lobes_can_be_sampled() -> None:
    """However many shape numbers a highlight and a body have together, nodes and cells are numbered for them."""
    kinds = [[lobe for lobe in LOBES.values() if lobe.kind == kind] for kind in ("specular", "diffuse")]
    counts = {len(gloss.parameters) + len(body.parameters) for gloss in kinds[0] for body in kinds[1]}
    assert counts <= set(NODES)
    assert counts - {0} <= set(POINTS)  # without a shape nothing is proposed
    assert max(counts) == 5
