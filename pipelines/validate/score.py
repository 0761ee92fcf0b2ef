"""What the finished trials say together: coverage, ranks, bias, scatter against the bound, failures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.records import Floats

from .efficiency import efficiency
from .ranks import covered, uniform_p
from .stress import Stress, alarmed, stress_of, worst_of, z_of

MISS_SDS = 5.0  # from which a render that kept every assumption is listed as missed


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
    relative_rmse: float  # over the root mean square truth
    efficiency: float  # rmse over the Cramer-Rao bound
    efficiency_error: float
    unit_rmse: float  # rmse in the number's own unit
    ranks: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pool:
    """Some numbers of all clean trials that have them, and how far chance alone moves what they say."""

    name: str
    count: int
    coverage: Mapping[float, float]
    coverage_error: float  # sd of the coverage at 90 % by chance alone
    mean_z2: float
    efficiency: float
    efficiency_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Everything that page, JSON and record are made of."""

    renders: int
    all: Pool
    models: tuple[Pool, ...]
    parameters: tuple[Pool, ...]
    groups: tuple[Group, ...]
    psnr_db: Floats
    stress: tuple[Stress, ...]
    failures: tuple[Mapping[str, Any], ...]
    missed: tuple[Mapping[str, Any], ...]  # clean trials with an alarm, or far from the truth
    false_alarms: float
    seconds: Mapping[str, float]  # median per stage of a trial


def score(lines: Sequence[Mapping[str, Any]]) -> Score:
    """Score the lines of a record; raises ValueError where no clean trial was finished."""
    done = [line for line in lines if line["status"] == "done"]
    clean = [line for line in done if not line["broken"]]
    if not clean:
        raise ValueError("no clean trial was finished")
    models = sorted({model_of(line) for line in clean})
    names = sorted({n["name"] for line in clean for n in line["numbers"]})
    return Score(
        renders=len(clean),
        all=_pool("all", clean),
        models=tuple(_pool(model, [line for line in clean if model_of(line) == model]) for model in models),
        parameters=tuple(_pool(name, clean, only=name) for name in names),
        groups=tuple(_groups(clean)),
        psnr_db=np.array([line["psnr_db"] for line in clean if line["psnr_db"] is not None]),
        stress=stress_of(lines),
        failures=tuple(line for line in lines if line["status"] != "done" and not line["broken"]),
        missed=tuple(line for line in clean if missed(line)),
        false_alarms=float(np.mean([alarmed(line) for line in clean])),
        seconds=_typical_seconds(clean),
    )


def missed(line: Mapping[str, Any]) -> bool:
    """Whether a finished clean trial deserves a look: an alarm, or a number far from its truth."""
    return alarmed(line) or worst_of(line) > MISS_SDS


def model_of(line: Mapping[str, Any]) -> str:
    """How the page calls a trial's two lobes."""
    return str(line["model"]) if line["diffuse"] == "lambert" else f"{line['model']} over {line['diffuse']}"


def _pool(name: str, clean: Sequence[Mapping[str, Any]], *, only: str | None = None) -> Pool:
    """Numbers of one render go together, renders do not: errors by chance are those of renders."""
    renders = [numbers for line in clean if (numbers := [n for n in line["numbers"] if only in (None, n["name"])])]
    numbers = [n for of_one in renders for n in of_one]
    held = np.array([np.mean([abs(n["rank"] - 0.5) <= 0.45 for n in of_one]) for of_one in renders])
    ratio, error, _ = efficiency(clean, only)
    return Pool(
        name=name,
        count=len(renders),
        coverage=covered(np.array([n["rank"] for n in numbers])),
        coverage_error=max(float(np.std(held) / len(held) ** 0.5), (0.9 * 0.1 / len(numbers)) ** 0.5),
        mean_z2=float(np.mean([z_of(n) ** 2 for n in numbers])),
        efficiency=ratio,
        efficiency_error=error,
    )


def _groups(clean: Sequence[Mapping[str, Any]]) -> list[Group]:
    found: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in clean:
        for name in {n["name"] for n in line["numbers"]}:
            found.setdefault((model_of(line), name), []).append(line)
    return [_group(model, name, lines) for (model, name), lines in sorted(found.items())]


def _group(model: str, name: str, lines: Sequence[Mapping[str, Any]]) -> Group:
    numbers = [n for line in lines for n in line["numbers"] if n["name"] == name]
    ranks, z = np.array([n["rank"] for n in numbers]), np.array([z_of(n) for n in numbers])
    channels = {n["channel"] for n in numbers}
    each = [np.array([n["rank"] for n in numbers if n["channel"] == channel]) for channel in channels]
    rmse, level = (_root_mean_square([f(n) for n in numbers]) for f in (_error, _truth))
    ratio, error, _ = efficiency(lines, name)
    return Group(
        model=model,
        name=name,
        count=len(lines),
        coverage=covered(ranks),
        mean_z=float(z.mean()),
        mean_z2=float(np.mean(z**2)),
        rank_p=min(1.0, len(each) * min(uniform_p(r) for r in each)),
        relative_rmse=rmse / level,
        efficiency=ratio,
        efficiency_error=error,
        unit_rmse=rmse,
        ranks=tuple(float(r) for r in ranks),
    )


def _error(number: Mapping[str, Any]) -> float:
    return float(number["mean"] - number["truth"])


def _truth(number: Mapping[str, Any]) -> float:
    return float(number["truth"])


def _root_mean_square(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _typical_seconds(clean: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    stages = list(dict.fromkeys(stage for line in clean for stage in line["seconds"]))
    return {stage: float(np.median([line["seconds"].get(stage, 0.0) for line in clean])) for stage in stages}
