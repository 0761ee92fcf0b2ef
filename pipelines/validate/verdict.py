"""Can the numbers be trusted? One sentence, and what speaks against it."""

from __future__ import annotations

from collections.abc import Iterator

from .broken import ASSUMPTIONS
from .score import Pool, Score
from .stress import Stress

BAND_90 = (0.87, 0.93)  # of a 90 % interval's coverage, over all and for each model
MOST_RATIO = 1.05  # of rmse over the bound, for each parameter over all models
MOST_MODEL_RATIO = 1.20  # and for each model over all parameters
CHANCE_SDS = 2.0  # by which a figure may miss its limit for chance alone
FAMILY_WISE = 0.01  # chance that right posteriors fail the rank test of any group
MOST_FALSE_FLAGS = 0.02  # of clean renders
NAMED = 4  # of many that are alike


def verdict(found: Score) -> str:
    """One sentence."""
    done = f"{found.renders} renders"
    if said := complaints(found):
        return f"Not to be trusted yet: over {done}, {'; '.join(said)}."
    return (
        f"To be trusted: over {done} of known truth the 90 % intervals held the truth in "
        f"{100 * found.all.coverage[0.9]:.1f} % of cases, ranks are even, and no fit failed."
    )


def complaints(found: Score) -> tuple[str, ...]:
    """What is wrong, in words; empty where all is well."""
    return (*_coverage(found), *_efficiency(found), *_ranks(found), *_alarms(found))


def least_p(found: Score) -> float:
    """The chance below which a group's ranks count as uneven: Bonferroni over all groups."""
    return FAMILY_WISE / max(len(found.groups), 1)


def _coverage(found: Score) -> Iterator[str]:
    expected = f"expected {100 * BAND_90[0]:.0f} to {100 * BAND_90[1]:.0f} %"
    off = [pool for pool in found.models if _uncovered(pool)]
    if _uncovered(found.all):
        yield f"90 % intervals held the truth in {100 * found.all.coverage[0.9]:.1f} % of cases, {expected}"
    elif off:
        each = _few([f"{100 * pool.coverage[0.9]:.1f} % of cases for {pool.name}" for pool in off])
        yield f"90 % intervals held the truth in {each}, {expected}"


def _uncovered(pool: Pool) -> bool:
    slack = CHANCE_SDS * pool.coverage_error
    return not BAND_90[0] - slack <= pool.coverage[0.9] <= BAND_90[1] + slack


def _efficiency(found: Score) -> Iterator[str]:
    for pools, most in ((found.parameters, MOST_RATIO), (found.models, MOST_MODEL_RATIO)):
        over = [pool for pool in pools if pool.efficiency - CHANCE_SDS * pool.efficiency_error > most]
        if over:
            each = _few([f"{pool.name} by {pool.efficiency:.2f}" for pool in over])
            yield f"answers scatter beyond the least possible ({each} x its sd), expected {most:g} or less"


def _ranks(found: Score) -> Iterator[str]:
    uneven = [f"{g.name} of {g.model}" for g in found.groups if g.rank_p < least_p(found)]
    if uneven:
        yield f"ranks are uneven for {_few(uneven)}"


def _alarms(found: Score) -> Iterator[str]:
    if found.failures:
        count = len(found.failures)
        yield f"{count} fit{'s' if count > 1 else ''} failed"
    if found.false_alarms > MOST_FALSE_FLAGS:
        yield f"{100 * found.false_alarms:.1f} % of clean renders raised an alarm"
    if silent := [_in_words(row) for row in found.stress if row.misleads]:
        yield f"wrong answers without an alarm for {_few(silent)}"


def _in_words(row: Stress) -> str:
    of = ASSUMPTIONS[row.name]
    return f"{of.says} ({row.amount:g} {of.unit})" if of.unit else of.says


def _few(names: list[str]) -> str:
    return ", ".join(names[:NAMED]) + (" and others" if len(names) > NAMED else "")
