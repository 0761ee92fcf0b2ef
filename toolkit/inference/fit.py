"""Least squares by variable projection: only the shape is searched, everything linear is solved for at each step.

A coarse search on a few cells with provisional weights, then Gauss-Newton on all of them and new weights in turn until
both stand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .normal import weigh
from .problem import Optimum, Problem, weights_at
from .refine import refine
from .search import search

PLAIN = 30.0  # chi-square on a few cells by which one optimum is plainly better than another


def fit(problem: Problem, *, start: Optimum | None = None) -> Optimum:
    """The optimum of a problem; `start`, of a neighbouring problem on the same cells, spares the search."""
    if start is not None:
        return refine(problem, start.u, weigh(start.weights.weights, problem.extras))
    found = search(problem)
    return min((_begin(problem, few) for few in found if few.chi2 < found[0].chi2 + PLAIN), key=lambda o: o.chi2)


def minima(problem: Problem) -> list[Optimum]:
    """The distinct optima that a search over the whole box comes to rest at, best first, `MOST_MINIMA` at most."""
    return sorted((_begin(problem, few) for few in search(problem)), key=lambda optimum: optimum.chi2)


def _begin(problem: Problem, few: Optimum) -> Optimum:
    """Go on with all cells from an optimum on a few of them, weighed by what it predicts."""
    problem = replace(problem, fresnel=few.problem.fresnel)
    cols = problem.columns(few.u, derivatives=True)
    x = np.concatenate([few.x, problem.prior.centre[len(few.x) :]])
    return refine(problem, few.u, weights_at(problem, problem.predict(cols, x)), cols)
