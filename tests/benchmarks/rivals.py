"""The usual ways to fit the reference problem and to sample its posterior, all over every pixel.

Each sees the pixels of `tests.benchmarks.reference.Pixels`: `same_job` does all that ours does, else the weights and a
start near the truth are given.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toolkit.inference.cells import Cells
from toolkit.records import Floats, LinearImage, Scene

from .reference import IRRADIANCE, NEUTRAL, START, Pixels, pixels

NAMES = ("red", "green", "blue", "f0_red", "f0_green", "f0_blue", "log_alpha")
WALKERS = 20
NUTS_DRAWS = 150  # and as many to warm up


def scipy_trf(pixels: Pixels, start: Floats = START) -> Floats:
    """Scipy's trust-region reflective least squares with its default 2-point differences."""
    from scipy.optimize import least_squares

    return np.asarray(least_squares(pixels.residuals(), start).x)


def lmfit_leastsq(pixels: Pixels, start: Floats = START) -> Floats:
    """Lmfit's default: Levenberg and Marquardt by MINPACK."""
    import lmfit

    parameters = lmfit.Parameters()
    for name, value in zip(NAMES, start, strict=True):
        parameters.add(name, value=value)
    of = pixels.residuals()
    found = lmfit.minimize(lambda p: of(np.array(list(p.valuesdict().values()))), parameters)
    return np.array(list(found.params.valuesdict().values()))


def same_job(fitter: Callable[[Pixels, Floats], Floats], image: LinearImage, scene: Scene, cells: Cells) -> Floats:
    """From pixels to optimum: geometry, a fit with the noisy samples' own weights, then two with the model's."""
    data = pixels(image, scene, cells)
    found = fitter(data, NEUTRAL)
    for _ in range(2):
        found = fitter(data.weighed(data.model(found)), found)
    return found


def emcee_effective_per_s(pixels: Pixels, optimum: Floats, seconds: Callable[[Callable[[], object]], float]) -> float:
    """Effective samples a second of emcee with its default move over all pixels.

    The time is that of one evaluation of the density. The autocorrelation time is emcee's own on a normal density of
    as many dimensions: stretches do not know an affine map of it from this posterior, and a chain over all pixels
    long enough to tell would take an hour.
    """
    import emcee

    of = pixels.residuals()
    once = seconds(lambda: -0.5 * float(np.sum(of(optimum) ** 2)))
    sampler = emcee.EnsembleSampler(WALKERS, len(optimum), lambda p: -0.5 * np.sum(p**2, axis=-1), vectorize=True)
    begin = np.random.default_rng(0).standard_normal((WALKERS, len(optimum)))
    sampler.run_mcmc(emcee.State(begin, random_state=np.random.RandomState(0).get_state()), 20_000)
    return 1.0 / (once * float(np.max(sampler.get_autocorr_time())))


def nuts_effective_per_s(pixels: Pixels, optimum: Floats, seconds: Callable[[Callable[[], object]], float]) -> float:
    """Effective samples a second of NumPyro's NUTS with its defaults over all pixels, compilation counted."""
    import jax
    import jax.numpy as jnp
    import numpyro
    from numpyro.diagnostics import effective_sample_size
    from numpyro.infer import MCMC, NUTS

    jax.config.update("jax_enable_x64", True)
    lit = pixels.lit.cosines
    fixed = {name: jnp.asarray(np.array(getattr(lit, name))) for name in ("n_dot_l", "n_dot_v", "n_dot_h", "sin2_h")}
    schlick, values = jnp.asarray(np.array(pixels.lit.schlick)), jnp.asarray(pixels.values)
    root = jnp.sqrt(jnp.asarray(pixels.weights))

    def one_sided(cosine: jnp.ndarray, alpha: jnp.ndarray) -> jnp.ndarray:
        a = cosine / jnp.sqrt(jnp.maximum(1.0 - cosine**2, 1e-30)) / alpha
        return jnp.where(a < 1.6, a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a)), 1.0)

    def radiance(p: jnp.ndarray) -> jnp.ndarray:
        alpha, cos2 = jnp.exp(p[6]), fixed["n_dot_h"] ** 2
        density = jnp.exp(-fixed["sin2_h"] / cos2 / alpha**2) / (jnp.pi * alpha**2 * cos2**2)
        hidden = one_sided(fixed["n_dot_l"], alpha) * one_sided(fixed["n_dot_v"], alpha)
        gloss = density * hidden / (4.0 * fixed["n_dot_v"])
        f = p[3:6, None] * (1.0 - schlick) + schlick
        return IRRADIANCE * (p[:3, None] * fixed["n_dot_l"] / jnp.pi + f * gloss)

    def model() -> None:
        p = numpyro.sample("p", numpyro.distributions.ImproperUniform(numpyro.distributions.constraints.real, (), (7,)))
        numpyro.factor("likelihood", -0.5 * jnp.sum(((radiance(p) - values) * root) ** 2))

    np.testing.assert_allclose(radiance(jnp.asarray(optimum)), pixels.model(optimum), rtol=1e-9)
    mcmc = MCMC(NUTS(model), num_warmup=NUTS_DRAWS, num_samples=NUTS_DRAWS, progress_bar=False)
    taken = seconds(lambda: mcmc.run(jax.random.PRNGKey(0), init_params={"p": jnp.asarray(optimum)}))
    return float(np.min(effective_sample_size(np.asarray(mcmc.get_samples(group_by_chain=True)["p"])))) / taken
