"""What the finished trials say together: coverage, ranks, bias, scatter against the bound, failures, the verdict.

Ranks: a truth's place among its posterior draws is uniform where intervals are right (Talts et al. 2018). Whether a
group's ranks are uniform is judged by the simultaneous band of Säilynoja, Bürkner & Vehtari (2022): the chance that
the ranks of a right posterior leave the most extreme of its pointwise binomial bands as far as these do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from toolkit.flags import Flag
from toolkit.records import Floats

LEVELS = (0.5, 0.68, 0.9, 0.95)
BAND_90 = (0.87, 0.93)  # of a 90 % interval's coverage
MOST_RATIO = 1.05  # of rmse over the bound, pooled
FAMILY_WISE = 0.01  # chance that right posteriors fail the rank test of any group
MOST_FALSE_FLAGS = 0.02  # of clean renders
MOST_SILENT = 0.1  # of the trials of a broken assumption; 5 % leave their intervals by chance
SIMULATED, POINTS = 4000, 60
ALARMS = frozenset(  # flags that say: do not believe these numbers
    {
        Flag.POOR_FIT,
        Flag.STRUCTURED_RESIDUALS,
        Flag.CALIBRATION_DOUBTED,
        Flag.NOT_CONVERGED,
        Flag.CHAIN_TOO_SHORT,
        Flag.LAYERS_DISAGREE,
        Flag.TRANSFER_ASSUMED,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """One parameter of one model over the clean trials (one channel of a colour counts as one number)."""

    model: str
    name: str
    count: int
    coverage: Mapping[float, float]
    mean_z: float
    mean_z2: float
    rank_p: float  # chance of ranks as uneven as these, the smallest over the channels
    relative_rmse: float
    efficiency: float  # rmse over the Cramer-Rao bound
    unit_rmse: float  # rmse in the number's own unit
    ranks: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stress:
    """One broken assumption by one amount, over its trials."""

    name: str
    amount: float
    count: int
    outside: float  # share of trials in which some number left its 95 % interval by more than right ones do
    silent: float  # share that did so without an alarm
    shift: float  # median over trials of the largest |truth - mean| / sd
    relative: float  # median over trials of the largest relative error of a number
    flagged: float  # share of trials with an alarm
    flags: tuple[str, ...]
    failed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Everything that page, JSON and record are made of."""

    renders: int
    coverage: Mapping[float, float]
    coverage_error: float  # sd of the coverage at 90 % by chance alone
    groups: tuple[Group, ...]
    mean_z2: float
    efficiency: float
    efficiency_error: float  # its sd by chance alone
    psnr_db: Floats
    stress: tuple[Stress, ...]
    failures: tuple[Mapping[str, Any], ...]
    false_alarms: float
    seconds: Mapping[str, float]  # mean per stage of a trial

    @property
    def complaints(self) -> tuple[str, ...]:
        """What is wrong, in words; empty where all is well."""
        return tuple(_complaints(self))

    @property
    def verdict(self) -> str:
        """One sentence."""
        done = f"{self.renders} renders"
        if self.complaints:
            return f"Not to be trusted yet: over {done}, {'; '.join(self.complaints)}."
        return (
            f"To be trusted: over {done} of known truth the 90 % intervals held the truth in "
            f"{100 * self.coverage[0.9]:.1f} % of cases, ranks are even, and no fit failed."
        )


def score(lines: Sequence[Mapping[str, Any]]) -> Score:
    """Score the lines of a record; raises ValueError where no clean trial was finished."""
    done = [line for line in lines if line["status"] == "done"]
    clean = [line for line in done if not line["broken"]]
    if not clean:
        raise ValueError("no clean trial was finished")
    ranks = np.array([n["rank"] for line in clean for n in line["numbers"]])
    z = np.array([z_of(n) for line in clean for n in line["numbers"]])
    alarms = [bool(ALARMS.intersection(line["flags"])) for line in clean]
    psnr = np.array([line["psnr_db"] for line in clean if line["psnr_db"] is not None])
    return Score(
        renders=len(clean),
        coverage=covered(ranks),
        coverage_error=_coverage_error(clean),
        groups=tuple(_groups(clean)),
        mean_z2=float(np.mean(z**2)),
        efficiency=_efficiency([n for line in clean for n in line["numbers"]]),
        efficiency_error=_efficiency_error(clean),
        psnr_db=psnr,
        stress=tuple(_stress(lines)),
        failures=tuple(line for line in lines if line["status"] != "done" and not line["broken"]),
        false_alarms=float(np.mean(alarms)),
        seconds=_mean_seconds(clean),
    )


def covered(ranks: Floats) -> dict[float, float]:
    """Share of central intervals at each level that hold their truth, from ranks in 0..1."""
    return {level: float(np.mean(np.abs(ranks - 0.5) <= 0.5 * level)) for level in LEVELS}


def uniform_p(ranks: Floats) -> float:
    """Chance that as many even ranks look as uneven as these (N,) do anywhere along their distribution."""
    null = _most_extreme_of_even(len(ranks))
    mine = _most_extreme(np.sort(ranks)[None])[0]
    return float((np.count_nonzero(null <= mine) + 1) / (len(null) + 1))


@cache
def _most_extreme_of_even(count: int) -> Floats:
    draws = np.random.default_rng(0).random((SIMULATED, count))
    return _most_extreme(np.sort(draws, axis=1))


def _most_extreme(ordered: Floats) -> Floats:
    """Smallest two-sided pointwise binomial probability along each row's empirical distribution (S, N)."""
    from scipy.stats import binom

    rows, count = ordered.shape
    at = np.arange(1, POINTS) / POINTS
    below = np.stack([np.searchsorted(row, at, side="right") for row in ordered])
    table = np.minimum(
        binom.cdf(np.arange(count + 1)[:, None], count, at), binom.sf(np.arange(count + 1)[:, None] - 1, count, at)
    )
    return np.asarray(np.minimum(2.0 * table[below, np.arange(len(at))], 1.0).min(axis=1)).reshape(rows)


def z_of(number: Mapping[str, Any]) -> float:
    """By how many of its posterior's sds a truth lies above the mean."""
    return float((number["truth"] - number["mean"]) / max(number["sd"], 1e-300))


def _coverage_error(clean: Sequence[Mapping[str, Any]]) -> float:
    """Sd of the pooled coverage at 90 %: numbers of one render go together, renders do not."""
    shares = [np.mean([abs(n["rank"] - 0.5) <= 0.45 for n in line["numbers"]]) for line in clean]
    return float(np.std(shares) / len(shares) ** 0.5)


def _efficiency_error(clean: Sequence[Mapping[str, Any]]) -> float:
    """Sd of the pooled efficiency by chance: renders are independent, the numbers of one are not."""
    each = np.array([_efficiency(line["numbers"]) ** 2 for line in clean])
    return float(0.5 * np.std(each) / len(each) ** 0.5)


def _groups(clean: Sequence[Mapping[str, Any]]) -> list[Group]:
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in clean:
        for number in line["numbers"]:
            found.setdefault((model_of(line), number["name"]), []).append(number)
    return [_group(model, name, numbers) for (model, name), numbers in sorted(found.items())]


def model_of(line: Mapping[str, Any]) -> str:
    """How the page calls a trial's two lobes."""
    return str(line["model"]) if line["diffuse"] == "lambert" else f"{line['model']} over {line['diffuse']}"


def _group(model: str, name: str, numbers: Sequence[Mapping[str, Any]]) -> Group:
    ranks, z = np.array([n["rank"] for n in numbers]), np.array([z_of(n) for n in numbers])
    channels = {n["channel"] for n in numbers}
    each = [np.array([n["rank"] for n in numbers if n["channel"] == channel]) for channel in channels]
    relative = [(n["mean"] - n["truth"]) / n["truth"] for n in numbers]
    return Group(
        model=model,
        name=name,
        count=len(each[0]),
        coverage=covered(ranks),
        mean_z=float(z.mean()),
        mean_z2=float(np.mean(z**2)),
        rank_p=min(1.0, len(each) * min(uniform_p(r) for r in each)),
        relative_rmse=float(np.sqrt(np.mean(np.square(relative)))),
        efficiency=_efficiency(numbers),
        unit_rmse=float(np.sqrt(np.mean([(n["mean"] - n["truth"]) ** 2 for n in numbers]))),
        ranks=tuple(float(r) for r in ranks),
    )


def _efficiency(numbers: Sequence[Mapping[str, Any]]) -> float:
    """Root of the mean squared error over the bound's variance; NaN where there is no bound."""
    squares = [((n["mean"] - n["truth"]) / n["bound_sd"]) ** 2 for n in numbers if n["bound_sd"]]
    return float(np.sqrt(np.mean(squares))) if squares else float("nan")


def _stress(lines: Sequence[Mapping[str, Any]]) -> list[Stress]:
    rows: dict[tuple[str, float], list[Mapping[str, Any]]] = {}
    for line in lines:
        if line["broken"]:
            rows.setdefault((line["broken"], line["amount"]), []).append(line)
    return [_stressed(name, amount, trials) for (name, amount), trials in rows.items()]


def _stressed(name: str, amount: float, trials: Sequence[Mapping[str, Any]]) -> Stress:
    done = [line for line in trials if line["status"] == "done"]
    worst = [max(abs(z_of(n)) for n in line["numbers"]) for line in done]
    relative = [max(abs(n["mean"] / n["truth"] - 1.0) for n in line["numbers"]) for line in done]
    alarmed = [bool(ALARMS.intersection(line["flags"])) for line in done]
    seen = sorted({flag for line in done for flag in line["flags"]})
    return Stress(
        name=name,
        amount=amount,
        count=len(trials),
        outside=float(np.mean([_leaves(line) for line in done])) if done else 0.0,
        silent=float(np.mean([_leaves(line) and not alarm for line, alarm in zip(done, alarmed, strict=True)]))
        if done
        else 0.0,
        shift=float(np.median(worst)) if done else float("nan"),
        relative=float(np.median(relative)) if done else float("nan"),
        flagged=(sum(alarmed) + len(trials) - len(done)) / len(trials),
        flags=tuple(seen),
        failed=len(trials) - len(done),
    )


def _leaves(line: Mapping[str, Any]) -> bool:
    """Whether the answer as a whole leaves its 95 % intervals: Bonferroni over its numbers."""
    tail = 0.025 / len(line["numbers"])
    return any(min(n["rank"], 1.0 - n["rank"]) < tail or abs(z_of(n)) > 4.0 for n in line["numbers"])


def _mean_seconds(clean: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    stages = list(dict.fromkeys(stage for line in clean for stage in line["seconds"]))
    return {stage: float(np.mean([line["seconds"].get(stage, 0.0) for line in clean])) for stage in stages}


def _complaints(found: Score) -> list[str]:
    said = []
    low, high = BAND_90[0] - 2 * found.coverage_error, BAND_90[1] + 2 * found.coverage_error
    if not low <= found.coverage[0.9] <= high:
        said.append(
            f"90 % intervals held the truth in {100 * found.coverage[0.9]:.1f} % of cases, "
            f"expected {100 * BAND_90[0]:.0f} to {100 * BAND_90[1]:.0f} %"
        )
    if found.efficiency - 2 * found.efficiency_error > MOST_RATIO:
        said.append(
            f"answers scatter by {found.efficiency:.2f} x the least possible, expected {MOST_RATIO:g} x or less"
        )
    uneven = [g for g in found.groups if g.rank_p < FAMILY_WISE / len(found.groups)]
    if uneven:
        names = ", ".join(f"{g.name} of {g.model}" for g in uneven[:4])
        said.append(f"ranks are uneven for {names}{' and others' if len(uneven) > 4 else ''}")
    if found.failures:
        said.append(f"{len(found.failures)} fits failed")
    if found.false_alarms > MOST_FALSE_FLAGS:
        said.append(f"{100 * found.false_alarms:.1f} % of clean renders raised an alarm")
    silent = [s for s in found.stress if s.silent * s.count >= 2 and s.silent > MOST_SILENT]
    if silent:
        said.append("wrong answers without an alarm for " + ", ".join(f"{s.name} {s.amount:g}" for s in silent))
    return said
