"""Least squares by variable projection: only the shape is searched, everything linear is solved for at each step.

A coarse search on a few cells with provisional weights, then Gauss-Newton on all of them and new weights in turn until
both stand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .problem import Optimum, Problem, weighing_at
from .refine import refine
from .search import search, thinned

PLAIN = 30.0  # chi-square on a few cells by which one optimum is plainly better than another


def fit(problem: Problem, *, start: Optimum | None = None) -> Optimum:
    """The optimum of a problem; `start`, of a neighbouring one, spares the search."""
    if start is not None:
        return go_on(problem, start)
    found = search(thinned(problem))
    plain = [few for few in found if few.chi2 < found[0].chi2 + PLAIN]
    return min((go_on(problem, few) for few in plain), key=lambda optimum: optimum.chi2)


def go_on(problem: Problem, start: Optimum) -> Optimum:
    """From the shape and colours of a neighbouring problem, as of one on fewer cells, weighed by what they predict."""
    problem = replace(problem, fresnel=start.problem.fresnel)
    columns = problem.columns(start.u, derivatives=True)
    x = np.zeros(problem.layout.size)
    x[: len(problem.layout.names)] = start.x[: len(problem.layout.names)]
    return refine(problem, start.u, weighing_at(problem, problem.predict(columns, x)), columns)
