"""How well a photograph could ever tell: the Cramer-Rao bound of a known material in a known scene.

The information that the samples hold on all unknowns at their true values, with what was known of the calibration
beforehand (the Bayesian bound, van Trees 1968), inverted: no unbiased estimate scatters less.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from toolkit.records import Floats

from .fit import Optimum, Problem, pose_views, weights_at
from .normal import inverse
from .nuisances import Shifts, sensitivity


def bound_sds(problem: Problem, truth: Mapping[str, Floats], shifts: Shifts) -> dict[str, Floats]:
    """Smallest possible sd of each number: (1,) for a shape number, (3,) for a colour, by name.

    `problem` is posed in the true scene; of its cells only places and numbers of samples count. `truth` holds every
    shape number and every linear one under the model's own names; the pedestal is taken as 0. Raises KeyError where
    one is missing.
    """
    there = _at(problem, truth)
    linear = pose_views(
        problem.model,
        problem.views,
        fresnel=problem.fresnel,
        extras=sensitivity(there, problem.views, shifts, np.zeros(len(shifts.names))),
        extras_precision=shifts.precision,
    )
    columns = linear.columns(there.u, derivatives=True)
    x = np.concatenate([there.x, np.zeros(len(shifts.names))])
    weights = weights_at(linear, linear.predict(columns, x))
    sd = np.sqrt(np.diag(inverse(linear.assemble(columns, weights, x).matrix)))
    result = {name: linear.layout.of(name, sd) for name in {name for name, _ in linear.layout.names}}
    for d, p in enumerate(problem.model.parameters):
        width = sd[linear.layout.size + d]
        result[p.name] = np.atleast_1d(width * float(np.squeeze(truth[p.name])) if p.log else width)
    return result


def _at(problem: Problem, truth: Mapping[str, Floats]) -> Optimum:
    """The problem at its truth, as if a fit had come to rest there."""
    u = [float(np.squeeze(truth[p.name])) for p in problem.model.parameters]
    u = [float(np.log(value)) if p.log else value for value, p in zip(u, problem.model.parameters, strict=True)]
    x = [
        0.0 if name.startswith("pedestal") else float(np.broadcast_to(truth[name], 3)[channel or 0])
        for name, channel in problem.layout.names
    ]
    size = len(u) + len(x)
    return Optimum(
        problem=problem,
        u=np.array(u),
        x=np.array(x),
        weights=weights_at(problem, tuple(data.value for data in problem.channels)),
        joint=np.eye(size),
        chi2=0.0,
        on_bound=np.zeros(size, bool),
        status="converged",
    )
