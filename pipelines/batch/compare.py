"""Two results, or two batches, side by side: what changed beyond its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pipelines.report.text import clean

from .held import Held, is_number
from .rows import CHANNELS, Lobes, lobes_of

LEVEL = 0.05  # chance of any false "changed" in the whole comparison (Holm 1979)


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One number in A and in B; `z` is the difference in sds of a difference of independent measurements."""

    where: str
    what: str
    lobes: str
    before: float
    before_sd: float
    after: float
    after_sd: float
    z: float
    p: float
    changed: bool


@dataclass(slots=True, kw_only=True)
class Comparison:
    """`numbers` are all that were compared, `remarks` what no number says: (name, remark)."""

    numbers: list[Change] = field(default_factory=list)
    remarks: list[tuple[str, str]] = field(default_factory=list)
    same_photographs: int = 0
    pairs: int = 0

    @property
    def changed(self) -> list[Change]:
        """What changed beyond its uncertainty, the surest first."""
        return sorted((one for one in self.numbers if one.changed), key=lambda one: -abs(one.z))


def compare(a: Held, b: Held) -> Comparison:
    """Every number that both hold, each of the same lobes; two single results are compared whatever their names."""
    told = Comparison()
    drafts: list[Change] = []
    for name, before, after in _pairs(a, b, told):
        told.pairs += 1
        drafts += _photograph(name, before, after, told)
    drafts += _materials(a, b)
    told.numbers = judged(drafts)
    return told


def _pairs(a: Held, b: Held, told: Comparison) -> Iterator[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    if a.one and b.one:
        (name, one), (_, other) = next(iter(a.results.items())), next(iter(b.results.items()))
        yield name, one, other
        return
    for name in sorted({*a.results, *b.results, *a.failed, *b.failed}):
        before, after = a.results.get(name), b.results.get(name)
        if before is not None and after is not None:
            yield clean(name), before, after
        else:
            told.remarks.append((clean(name), f"{_state(a, name)} in A, {_state(b, name)} in B"))


def _state(held: Held, name: str) -> str:
    return "done" if name in held.results else "failed" if name in held.failed else "not there"


def _photograph(name: str, before: Mapping[str, Any], after: Mapping[str, Any], told: Comparison) -> list[Change]:
    digests = [_digests(one) for one in (before, after)]
    told.same_photographs += None not in digests[0] and digests[0] == digests[1]
    fits = [_fits(one) for one in (before, after)]
    best = [_best(one) for one in (before, after)]
    if best[0] != best[1]:
        told.remarks.append((name, f"best model {_words(best[0])} in A, {_words(best[1])} in B"))
    told.remarks += [(name, remark) for remark in _flags(before, after)]
    lobes = _common(best, fits)
    if lobes is None:
        told.remarks.append((name, "no model in both: no number can be compared"))
        return []
    return list(_numbers(name, lobes, fits[0][lobes], fits[1][lobes]))


def _digests(result: Mapping[str, Any]) -> list[object]:
    """Of the photograph, or of all that were fitted jointly."""
    told = result.get("photographs") or [result]
    return [(one.get("image") or {}).get("sha256") for one in told]


def _fits(result: Mapping[str, Any]) -> dict[Lobes, Mapping[str, Any]]:
    return {lobes_of(fit): fit for fit in result["fits"] if isinstance(fit, dict) and fit.get("status") == "converged"}


def _best(result: Mapping[str, Any]) -> Lobes | None:
    best, fits = result.get("best"), result["fits"]
    return lobes_of(fits[best]) if isinstance(best, int) and 0 <= best < len(fits) else None


def _common(best: Sequence[Lobes | None], fits: Sequence[Mapping[Lobes, Mapping[str, Any]]]) -> Lobes | None:
    """The best of either, where both have it; else of those in both the one of largest summed elpd."""
    for lobes in best:
        if lobes is not None and all(lobes in one for one in fits):
            return lobes
    shared = [lobes for lobes in fits[0] if lobes in fits[1]]
    return max(shared, key=lambda lobes: sum(one[lobes].get("elpd") or -math.inf for one in fits), default=None)


def _words(lobes: Lobes | None) -> str:
    return "none" if lobes is None else f"{lobes[0]}{f' ({lobes[1]})' if lobes[1] else ''} over {lobes[2]}"


def _flags(before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[str]:
    a, b = ({clean(flag) for flag in one.get("flags") or ()} for one in (before, after))
    if a - b:
        yield f"no longer flagged {', '.join(sorted(a - b))}"
    if b - a:
        yield f"newly flagged {', '.join(sorted(b - a))}"


def _numbers(name: str, lobes: Lobes, before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Change]:
    for parameter, a in (before.get("parameters") or {}).items():
        b = (after.get("parameters") or {}).get(parameter)
        if not isinstance(a, dict) or not isinstance(b, dict):
            continue
        parts = [_list(one.get(key)) for one in (a, b) for key in ("estimate", "sd")]
        if len({len(part) for part in parts}) != 1:
            continue
        for channel, numbers in enumerate(zip(*parts, strict=True)):
            label = f"{clean(parameter)}{f' {CHANNELS[channel]}' if 1 < len(parts[0]) <= len(CHANNELS) else ''}"
            if all(is_number(number) for number in numbers):
                yield _change(name, label, _words(lobes), *numbers)


def _list(value: object) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _materials(a: Held, b: Held) -> Iterator[Change]:
    for key, (mean, sd) in a.pooled.items():
        if key in b.pooled:
            material, model, variant, diffuse, parameter, channel = map(clean, key)
            words = _words((model, variant, diffuse))
            yield _change(f"material {material}", f"{parameter} {channel}".strip(), words, mean, sd, *b.pooled[key])


def _change(
    where: str, what: str, lobes: str, before: float, before_sd: float, after: float, after_sd: float
) -> Change:
    """Not yet judged: that takes all of them."""
    sd = math.hypot(before_sd, after_sd)
    z = (after - before) / sd if sd > 0 else math.copysign(math.inf, after - before) if after != before else 0.0
    return Change(
        where=where,
        what=what,
        lobes=lobes,
        before=before,
        before_sd=before_sd,
        after=after,
        after_sd=after_sd,
        z=z,
        p=math.erfc(abs(z) / math.sqrt(2)),
        changed=False,
    )


def judged(drafts: Sequence[Change]) -> list[Change]:
    """Which changed: Holm's step-down, so that the chance of any false one among all is at most LEVEL."""
    order = sorted(range(len(drafts)), key=lambda i: drafts[i].p)
    found: set[int] = set()
    for rank, index in enumerate(order):
        if drafts[index].p > LEVEL / (len(drafts) - rank):
            break
        found.add(index)
    return [replace(one, changed=index in found) for index, one in enumerate(drafts)]
