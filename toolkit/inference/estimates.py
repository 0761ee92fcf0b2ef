"""From draws to what a person reads: estimates with intervals, by name and unit, and what the data cannot tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.flags import Flag
from toolkit.records import Estimate, Floats
from toolkit.reflectance.factor import reflectance_factor
from toolkit.reflectance.fresnel import reflectance

from .model import mirror_cosine
from .normal import numbered
from .posterior import Draws
from .problem import Optimum, f0_of
from .solving import inverse
from .views import signal_scale

UNIFORM_SD = 12**-0.5  # of a uniform prior, per unit of its width
UNIDENTIFIED = 0.5  # posterior over prior width from which a parameter counts as not identified
POOR_CHI2 = 1.5  # of the cells' means, which hold some ten to a hundred samples each
POOR_RESIDUAL = 0.002  # of the signal: below, a misfit shows only since the photograph is so free of noise
DIELECTRIC_F0 = 0.2  # diamond's is 0.17: above, it is a metal and Schlick's form is as good as any
SCHLICK_IS_GOOD = 0.02  # relative difference from the exact form that is never told
REFLECTED = {
    "diffuse_albedo",
    "reflectance_factor",
    "specular_albedo",
    "specular_strength",
}  # what the irradiance divides
IRRADIANCE_STREAM = 1  # of the seed: draws independent of the sampler's
DETECTED_SD = 3.0  # sds by which a specular strength must stand above nothing

F0_NOTE = (
    "one light, or several at one angle to the view, show F0 and the unknown scale only as their product: "
    "give the irradiance, or a second light at another angle"
)


def named_draws(optimum: Optimum, u: Floats, x: Floats) -> dict[str, Floats]:
    """Draws by parameter name: (S,) for a shape number, (S, 3) for a colour."""
    problem = optimum.problem
    result: dict[str, Floats] = {
        p.name: np.exp(u[:, d]) if p.log else u[:, d] for d, p in enumerate(problem.model.parameters)
    }
    albedo = problem.layout.of("diffuse_albedo", x)
    factor = reflectance_factor(problem.model.diffuse, tuple(result[p.name] for p in problem.model.diffuse.parameters))
    result["diffuse_albedo"], result["reflectance_factor"] = albedo, albedo * factor[..., None]
    result.update(_specular_draws(optimum, x))
    result.update({name: problem.layout.of(name, x) for name in _pedestals(optimum)})
    return result


def _pedestals(optimum: Optimum) -> tuple[str, ...]:
    return tuple(numbered("pedestal", v) for v in range(len(optimum.problem.views)))


def _specular_draws(optimum: Optimum, x: Floats) -> dict[str, Floats]:
    problem = optimum.problem
    fresnel, layout = problem.fresnel, problem.layout
    if fresnel.kind == "none":
        return {"specular_albedo": layout.of("specular_albedo", x)}
    if fresnel.kind == "strength":
        return {"specular_strength": layout.of("specular_strength", x)}
    f0 = f0_of(problem, x)
    scale = 1.0 if fresnel.kind == "known" else layout.of("specular_scale", x)
    return {"specular_strength": scale * fresnel.at_mirror(f0), "specular_f0": f0}


def posterior_draws(optimum: Optimum, draws: Draws, told: Sequence[Floats | None]) -> dict[str, Floats]:
    """`named_draws` of the posterior, with the irradiance's own error where a card told it.

    `told`: of each photograph whose irradiance counts as known and is no shift, its relative covariance (3, 3) or None.

    Radiance fixes the product of irradiance and reflectance: every draw takes an irradiance of its own, and what is
    reflected is divided by it. F0 follows its strength by Fresnel's slope. Photographs fitted jointly count as sharing
    their card.
    """
    named = named_draws(optimum, draws.u, draws.x)
    if all(covariance is None for covariance in told):
        return named
    covariance = np.mean([np.zeros((3, 3)) if each is None else each for each in told], axis=0)
    rng = np.random.default_rng([draws.diagnostics.seed, IRRADIANCE_STREAM])
    factor = np.exp(rng.multivariate_normal(np.zeros(3), covariance, size=len(draws.x)))
    before = named.get("specular_strength", np.zeros(1))
    for name in REFLECTED & set(named):
        neutral = not np.ptp(named[name], axis=1).any()  # one number for all channels stays one
        named[name] = named[name] * (factor.mean(axis=1, keepdims=True) if neutral else factor)
    if optimum.problem.fresnel.kind == "known":
        steps = (named["specular_strength"] - before) / optimum.problem.fresnel.slope_at_mirror()
        named["specular_f0"] = named["specular_f0"] + steps
    return named


def unit_of(optimum: Optimum, name: str) -> str:
    """Unit of a parameter as a reader should see it."""
    for p in optimum.problem.model.parameters:
        if p.name == name:
            return p.unit
    if name.startswith("pedestal"):
        return "image units"
    relative = optimum.problem.scale == "relative" and name != "specular_f0"
    return "relative" if relative else "1"


def estimates_of(
    optimum: Optimum, by_name: Mapping[str, Floats], statistical: Mapping[str, Floats]
) -> tuple[Estimate, ...]:
    """Every parameter with mean, mode, sds and equal-tailed intervals of its posterior draws `by_name`; `statistical`
    sds where there are.
    """
    mode = named_draws(optimum, optimum.u[None], optimum.x[None])
    prior, bound = _prior_sds(optimum), _on_bound(optimum)
    result = [
        _estimate(optimum, name, values, mode[name][0], statistical.get(name), prior[name], at_bound=name in bound)
        for name, values in by_name.items()
    ]
    if optimum.problem.fresnel.kind == "strength":
        result.append(_unidentified_f0())
    return tuple(result)


def _on_bound(optimum: Optimum) -> set[str]:
    """The parameters, as they are told, one of whose numbers the fit left on a bound."""
    layout, model = optimum.problem.layout, optimum.problem.model
    linear, shape = optimum.on_bound[: len(layout.names)], optimum.on_bound[layout.size :]
    found = {name for (name, _), on in zip(layout.names, linear, strict=True) if on}
    if any(name.startswith("specular") for name in found):
        found |= {"specular_strength", "specular_f0"}  # one is told by the other
    if "diffuse_albedo" in found:
        found.add("reflectance_factor")  # a multiple of it
    return found | {p.name for p, on in zip(model.parameters, shape, strict=True) if on}


def _estimate(
    optimum: Optimum,
    name: str,
    values: Floats,
    mode: Floats,
    statistical: Floats | None,
    prior_sd: Floats,
    *,
    at_bound: bool,
) -> Estimate:
    values = np.ascontiguousarray(values.T)  # numpy sums along the first axis of so narrow a table slowly
    sd = values.std(axis=-1, ddof=1)
    wide = not name.startswith("pedestal") and np.max(sd / prior_sd) > UNIDENTIFIED
    low68, low90, high90, high68 = np.percentile(values, [16, 5, 95, 84], axis=-1)
    return Estimate(
        name=name,
        unit=unit_of(optimum, name),
        estimate=values.mean(axis=-1),
        mode=mode,
        sd=sd,
        sd_statistical=statistical,
        interval_68=(low68, high68),
        interval_90=(low90, high90),
        posterior_to_prior=sd / prior_sd,
        flags=(*((Flag.NEAR_BOUND,) if at_bound else ()), *((Flag.NOT_IDENTIFIED,) if wide else ())),
    )


def _unidentified_f0() -> Estimate:
    return Estimate(
        name="specular_f0",
        unit="1",
        estimate=None,
        mode=None,
        sd=None,
        sd_statistical=None,
        interval_68=None,
        interval_90=None,
        posterior_to_prior=np.ones(3),
        note=F0_NOTE,
        flags=(Flag.NOT_IDENTIFIED,),
    )


def statistical_sds(optimum: Optimum) -> dict[str, Floats]:
    """Sds that the noise alone would leave, were the calibration exactly known; none for derived ratios."""
    problem = optimum.problem
    named = len(problem.layout.names)
    keep = np.r_[0:named, problem.layout.size : len(optimum.joint)]
    sd = np.sqrt(np.maximum(np.diag(inverse(optimum.joint[np.ix_(keep, keep)])), 0.0))
    linear = np.concatenate([sd[:named], np.zeros(problem.layout.size - named)])
    result: dict[str, Floats] = {}
    shape = problem.model.natural(optimum.u)
    for d, p in enumerate(problem.model.parameters):
        result[p.name] = np.asarray(sd[named + d] * (shape[d] if p.log else 1.0))
    for name in {name for name, _ in problem.layout.names} - {"specular_scale_f0", "specular_scale"}:
        result[name] = problem.layout.of(name, linear)
    if problem.fresnel.kind == "known":
        result["specular_strength"] = result["specular_f0"] * problem.fresnel.slope_at_mirror()
    return result


def _prior_sds(optimum: Optimum) -> dict[str, Floats]:
    """Sds of the priors that the parameters are judged against: what was known before the photograph."""
    problem = optimum.problem
    first = problem.views[0]
    light = np.max([lamp.at(np.zeros((1, 3)))[1] for lamp in first.scene.lights])
    unit = 1.0 if problem.scale == "absolute" else np.pi * signal_scale(first.cells) / light
    result: dict[str, Floats] = {}
    shape = problem.model.natural(optimum.u)
    for number, p in zip(shape, problem.model.parameters, strict=True):
        width = number * np.log(p.high / p.low) if p.log else p.high - p.low
        result[p.name] = np.asarray(width * UNIFORM_SD)
    colour = np.full(3, unit * UNIFORM_SD)
    prior = np.diag(problem.prior.precision) ** -0.5
    pedestals = {name: problem.layout.of(name, prior) for name in _pedestals(optimum)}
    return (
        result
        | pedestals
        | {
            "diffuse_albedo": colour,
            "reflectance_factor": colour,
            "specular_albedo": colour,
            "specular_strength": colour,
            "specular_f0": np.full(3, UNIFORM_SD),
        }
    )


def flags_of(
    optimum: Optimum, estimates: tuple[Estimate, ...], draws: Draws, misfit: tuple[float, float]
) -> tuple[str, ...]:
    """What a reader of this fit must know; `misfit` is the reduced chi-square and the relative rms residual."""
    found: list[str] = []
    if optimum.status != "converged":
        found.append(Flag.NOT_CONVERGED)
    if not draws.long_enough:
        found.append(Flag.CHAIN_TOO_SHORT)
    of_one = {flag for estimate in estimates for flag in estimate.flags}
    found += [flag for flag in (Flag.NEAR_BOUND, Flag.NOT_IDENTIFIED) if flag in of_one]
    if not _detected(optimum):
        found.append(Flag.NO_SPECULAR)
    if misfit[0] > POOR_CHI2 and misfit[1] > POOR_RESIDUAL:
        found.append(Flag.POOR_FIT)
    return tuple(found)


def _detected(optimum: Optimum) -> bool:
    """Whether the specular coefficients stand above nothing, together, at the shape that was found.

    At that shape, since strength and width of a highlight whose core is clipped trade against each other.
    """
    layout = optimum.problem.layout
    specular = [i for i, (name, _) in enumerate(layout.names) if name.startswith("specular")]
    covariance = inverse(optimum.joint[: layout.size, : layout.size])[np.ix_(specular, specular)]
    found = optimum.x[specular]
    return bool(found @ np.linalg.pinv(covariance) @ found > len(specular) * DETECTED_SD**2)


def schlick_misleads(optimum: Optimum, estimates: tuple[Estimate, ...]) -> bool:
    """Whether F0 was told from angles at which Schlick's form misses a dielectric's by more than F0's own error.

    Residuals cannot tell: a wrong F0 and a wrong scale take up the difference. So the form is compared with the exact
    one at the mirror geometries of the lights, where F0 is one that a dielectric could have.
    """
    fresnel = optimum.problem.fresnel
    found = next((e for e in estimates if e.name == "specular_f0" and e.estimate is not None), None)
    if found is None or fresnel.choice != "schlick" or fresnel.kind not in ("known", "pair"):
        return False
    f0, sd = float(np.mean(found.estimate)), float(np.mean(found.sd))  # type: ignore[arg-type]  # not None here
    if not 0.0 < f0 < DIELECTRIC_F0:
        return False
    cosines = np.array([mirror_cosine(v.scene, light) for v in optimum.problem.views for light in v.scene.lights])
    taken, exact = (reflectance(cosines, f0, choice) for choice in ("schlick", "dielectric"))
    apart = np.log(taken / exact)
    worst = np.ptp(apart) if fresnel.kind == "pair" else np.max(np.abs(apart))  # a scale of its own takes up the mean
    return bool(worst > max(sd / f0, SCHLICK_IS_GOOD))
