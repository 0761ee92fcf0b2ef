"""How well a photograph could ever tell: the Cramer-Rao bound of a known material in a known scene.

The information that the samples hold on all unknowns at their true values, with what was known of the calibration
beforehand (the Bayesian bound, van Trees 1968), inverted: no unbiased estimate scatters less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from toolkit.records import Floats

from .nuisances import Shifts
from .problem import Optimum, Problem, weighing_at
from .sensitivity import sensitivity
from .solving import inverse

Truth = Mapping[str, Floats | float]


def bound_sds(problem: Problem, truth: Truth, shifts: Shifts) -> dict[str, Floats]:
    """Smallest possible sd of each number: (1,) for a shape number, (3,) for a colour, by name.

    `problem` is posed in the true scene, of one photograph or of several; of its cells only places and numbers of
    samples count. `truth` holds every shape number and colour by a result's names, the scale taken as 1 and the
    pedestals as 0; of `specular_f0` and `specular_strength` the one that the scene can tell. Raises KeyError where
    one is missing.
    """
    if "specular_f0" in truth:  # a dielectric's tangent touches at the truth
        problem = replace(problem, fresnel=replace(problem.fresnel, f0=float(np.mean(truth["specular_f0"]))))
    there = at_truth(problem, truth)
    nowhere = np.zeros(len(shifts.names))
    extras = sensitivity(there, problem.views, problem.views, shifts, nowhere)
    linear = problem.with_extras(extras, shifts.precision, nowhere)
    columns = linear.columns(there.u, derivatives=True)
    x = np.concatenate([there.x, nowhere])
    weights = weighing_at(linear, linear.predict(columns, x))
    covariance = inverse(linear.assemble(columns, weights, x).matrix)
    sd = np.sqrt(np.diag(covariance))
    result = {name: linear.layout.of(name, sd) for name in {name for name, _ in linear.layout.names}}
    if problem.fresnel.kind == "pair":
        result |= _pair_sds(linear, covariance, x)
    for d, p in enumerate(problem.model.parameters):
        width = sd[linear.layout.size + d]
        result[p.name] = np.atleast_1d(width * float(np.squeeze(truth[p.name])) if p.log else width)
    return result


def _pair_sds(problem: Problem, covariance: Floats, x: Floats) -> dict[str, Floats]:
    """Of F0 = (ks F0) / ks and of the strength b (ks F0) + a ks, to first order, per channel."""
    names, fresnel = list(problem.layout.names), problem.fresnel
    slope = fresnel.slope_at_mirror()
    found: dict[str, list[float]] = {"specular_f0": [], "specular_strength": []}
    for channel in range(3):
        i = next(i for i, (n, c) in enumerate(names) if n == "specular_scale_f0" and c in (channel, None))
        both = [i, names.index(("specular_scale", None))]
        product, scale = x[both]
        offset = float(fresnel.at_mirror(product / scale)) - slope * product / scale
        for name, by in (
            ("specular_f0", np.array([1.0, -product / scale]) / scale),
            ("specular_strength", np.array([slope, offset])),
        ):
            found[name].append(float(np.sqrt(by @ covariance[np.ix_(both, both)] @ by)))
    return {name: np.array(values) for name, values in found.items()}


def at_truth(problem: Problem, truth: Truth) -> Optimum:
    """The problem at its truth, as if a fit had come to rest there."""
    u = [float(np.squeeze(truth[p.name])) for p in problem.model.parameters]
    u = [float(np.log(value)) if p.log else value for value, p in zip(u, problem.model.parameters, strict=True)]
    x = [_linear(problem, truth, name, channel) for name, channel in problem.layout.names]
    size, columns = len(u) + len(x), problem.columns(np.array(u), derivatives=True)
    return Optimum(
        problem=problem,
        u=np.array(u),
        x=np.array(x),
        weights=weighing_at(problem, tuple(data.value for data in problem.channels)),
        joint=np.eye(size),
        chi2=0.0,
        on_bound=np.zeros(size, bool),
        status="converged",
        at=np.array(u),
        columns=columns,
        predicted=problem.predict(columns, np.array(x)),
    )


def _linear(problem: Problem, truth: Truth, name: str, channel: int | None) -> float:
    """A linear unknown's true value."""
    if name.startswith("pedestal"):
        return 0.0
    if name == "specular_scale":
        return 1.0
    if name == "specular_strength" and name not in truth:
        value = problem.fresnel.at_mirror(np.asarray(truth["specular_f0"]))
    else:
        value = np.asarray(truth["specular_f0" if name == "specular_scale_f0" else name])
    return float(np.broadcast_to(value, 3)[channel or 0])
