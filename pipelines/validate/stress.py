"""What broken assumptions did, and which flags said so."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.flags import Flag

BY_CHANCE = 0.05  # of right answers leave their 95 % intervals
LEAST_P = 0.02  # chance of as many silent ones, from which they are not put down to it: 3 of 12
FAR_SDS = 4.0  # beyond which a rank among some thousand draws no longer tells how far
ALARMS = frozenset(  # flags that say: do not believe these numbers
    {
        Flag.POOR_FIT,
        Flag.STRUCTURED_RESIDUALS,
        Flag.CALIBRATION_DOUBTED,
        Flag.NOT_CONVERGED,
        Flag.CHAIN_TOO_SHORT,
        Flag.LAYERS_DISAGREE,
        Flag.TRANSFER_ASSUMED,
        Flag.CLIPPED,
        Flag.HIGHLIGHT_CLIPPED,
    }
)


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

    @property
    def misleads(self) -> bool:
        """Whether it leads astray in silence more often than chance explains."""
        from scipy.stats import binom

        return bool(binom.sf(round(self.silent * self.count) - 1, self.count, BY_CHANCE) < LEAST_P)


def stress_of(lines: Sequence[Mapping[str, Any]]) -> tuple[Stress, ...]:
    """One row an assumption and amount."""
    rows: dict[tuple[str, float], list[Mapping[str, Any]]] = {}
    for line in lines:
        if line["broken"]:
            rows.setdefault((line["broken"], line["amount"]), []).append(line)
    return tuple(_row(name, amount, trials) for (name, amount), trials in rows.items())


def z_of(number: Mapping[str, Any]) -> float:
    """By how many of its posterior's sds a truth lies above the mean."""
    return float((number["truth"] - number["mean"]) / max(number["sd"], 1e-300))


def worst_of(line: Mapping[str, Any]) -> float:
    """The largest |z| of a trial's numbers."""
    return max(abs(z_of(number)) for number in line["numbers"])


def alarmed(line: Mapping[str, Any]) -> bool:
    """Whether a flag says not to believe the answer."""
    return bool(ALARMS.intersection(line["flags"]))


def leaves(line: Mapping[str, Any]) -> bool:
    """Whether the answer as a whole leaves its 95 % intervals: Bonferroni over its numbers."""
    tail = 0.025 / len(line["numbers"])
    return any(min(n["rank"], 1.0 - n["rank"]) < tail or abs(z_of(n)) > FAR_SDS for n in line["numbers"])


def _row(name: str, amount: float, trials: Sequence[Mapping[str, Any]]) -> Stress:
    done = [line for line in trials if line["status"] == "done"]
    worst = [worst_of(line) for line in done]
    relative = [max(abs(n["mean"] - n["truth"]) / max(n["truth"], n["sd"]) for n in line["numbers"]) for line in done]
    refused = len(trials) - len(done)
    return Stress(
        name=name,
        amount=amount,
        count=len(trials),
        outside=_share([leaves(line) for line in done]),
        silent=_share([leaves(line) and not alarmed(line) for line in done]),
        shift=float(np.median(worst)) if done else float("nan"),
        relative=float(np.median(relative)) if done else float("nan"),
        flagged=(sum(alarmed(line) for line in done) + refused) / len(trials),
        flags=tuple(sorted({flag for line in done for flag in line["flags"]})),
        failed=refused,
    )


def _share(told: Sequence[bool]) -> float:
    return float(np.mean(told)) if told else 0.0
