"""A validation as others read it: the JSON object, the CSV table, and what changed since the last record."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit import __version__
from toolkit.errors import BadInputError

from .score import Group, Pool, Score, model_of
from .stress import Stress, worst_of
from .verdict import complaints, verdict

SCHEMA = "fit-material/validation/1"
MAX_BYTES = 1 << 22
WORSE_SDS = 3.0  # of a figure's own error by chance, from which a change for the worse is real
WORSE_DB = 1.0
COLUMNS = (
    "number,model,diffuse,broken,amount,status,parameter,channel,truth,mean,sd,rank,bound_sd,psnr_db,chi2_reduced,flags"
)


def outcome(found: Score, *, seconds: float, trials: str) -> dict[str, Any]:
    """What `--json` prints and the record keeps."""
    said = complaints(found)
    return {
        "schema": SCHEMA,
        "version": __version__,
        "trials": trials,
        "renders": found.renders,
        "verdict": verdict(found),
        "good": not said,
        "complaints": list(said),
        **_statistics(found.all),
        "coverage_error": found.all.coverage_error,
        "psnr_db": float(sorted(found.psnr_db)[len(found.psnr_db) // 2]) if len(found.psnr_db) else None,
        "false_alarms": found.false_alarms,
        "models": [_pool(pool) for pool in found.models],
        "parameters": [_pool(pool) for pool in found.parameters],
        "groups": [_group(group) for group in found.groups],
        "stress": [_stress(row) for row in found.stress],
        "missed": [_missed(line) for line in found.missed],
        "failures": [dict(line) for line in found.failures],
        "seconds": seconds,
    }


def _pool(pool: Pool) -> dict[str, Any]:
    return {
        "name": pool.name,
        "renders": pool.count,
        **_statistics(pool),
        "coverage_error": pool.coverage_error,
    }


def _group(group: Group) -> dict[str, Any]:
    return {
        "model": group.model,
        "parameter": group.name,
        "renders": group.count,
        **_statistics(group),
        "mean_z": group.mean_z,
        "rank_p": group.rank_p,
        "relative_rmse": group.relative_rmse,
        "rmse": group.unit_rmse,
    }


def _statistics(one: Group | Pool) -> dict[str, Any]:
    """What is told of any numbers of any renders."""
    return {
        "coverage": {f"{level:g}": share for level, share in one.coverage.items()},
        "mean_z2": one.mean_z2,
        "efficiency": _or_null(one.efficiency),
        "efficiency_error": _or_null(one.efficiency_error),
    }


def _stress(row: Stress) -> dict[str, Any]:
    return {
        "assumption": row.name,
        "amount": row.amount,
        "renders": row.count,
        "largest_shift_sd": _or_null(row.shift),
        "largest_shift_relative": _or_null(row.relative),
        "outside": row.outside,
        "flagged": row.flagged,
        "silent": row.silent,
        "misleads": row.misleads,
        "flags": list(row.flags),
    }


def _missed(line: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "file": line["file"],
        "model": model_of(line),
        "flags": line["flags"],
        "largest_shift_sd": worst_of(line),
    }


def _or_null(value: float) -> float | None:
    """JSON has no NaN."""
    return value if math.isfinite(value) else None


def table(lines: Sequence[Mapping[str, Any]]) -> str:
    """One row a number of a trial, as CSV; a failed trial has one row."""
    held = io.StringIO()
    writer = csv.DictWriter(held, COLUMNS.split(","), extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    for line in lines:
        shared = {**line, "flags": " ".join(line.get("flags", ()))}
        for number in line.get("numbers", ({"name": ""},)):
            writer.writerow({**shared, **number, "parameter": number["name"], "number": line["number"]})
    return held.getvalue()


def read_record(path: Path) -> Mapping[str, Any]:
    """An earlier outcome; raises BadInputError where the file holds none."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError("too large")
        record = json.loads(path.read_bytes())
        if record["schema"] != SCHEMA:
            raise ValueError("another schema")
        worse(record, record)  # everything that a comparison will want is there
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BadInputError(
            f"{path} holds no validation record; expected the validation.json of an earlier run"
        ) from error
    return record  # type: ignore[no-any-return]  # its schema is checked, its numbers where they are used


def worse(now: Mapping[str, Any], before: Mapping[str, Any]) -> list[str]:
    """What changed for the worse by more than chance, in words; empty where nothing did.

    Each model and each parameter is compared for itself, so that the many that are well hide none that is not.
    """
    said: list[str] = []
    for kind in ("models", "parameters"):
        earlier = {pool["name"]: pool for pool in before[kind]}
        for pool in now[kind]:
            if pool["name"] in earlier:
                said += _pool_worse(pool, earlier[pool["name"]])
    if len(now["failures"]) > len(before["failures"]):
        said.append(f"failures went from {len(before['failures'])} to {len(now['failures'])}")
    error = math.sqrt(sum(one["false_alarms"] / one["renders"] for one in (now, before)))
    if now["false_alarms"] - before["false_alarms"] > WORSE_SDS * error:
        said.append(f"false alarms went from {100 * before['false_alarms']:.1f} to {100 * now['false_alarms']:.1f} %")
    if now["psnr_db"] is not None and before["psnr_db"] is not None and now["psnr_db"] < before["psnr_db"] - WORSE_DB:
        said.append(f"the diffuse layer's PSNR went from {before['psnr_db']:.1f} to {now['psnr_db']:.1f} dB")
    misled = {(s["assumption"], s["amount"]) for s in before["stress"] if s["misleads"]}
    said += [
        f"{s['assumption']} {s['amount']:g} now misleads without an alarm"
        for s in now["stress"]
        if s["misleads"] and (s["assumption"], s["amount"]) not in misled
    ]
    return said


def _pool_worse(now: Mapping[str, Any], before: Mapping[str, Any]) -> Iterator[str]:
    off, was = (abs(one["coverage"]["0.9"] - 0.9) for one in (now, before))
    if off - was > WORSE_SDS * math.hypot(now["coverage_error"], before["coverage_error"]):
        shares = [f"{100 * one['coverage']['0.9']:.1f}" for one in (before, now)]
        yield f"coverage of 90 % intervals of {now['name']} went from {shares[0]} to {shares[1]} %"
    if None in (now["efficiency"], before["efficiency"]):
        return
    if now["efficiency"] - before["efficiency"] > WORSE_SDS * math.hypot(
        now["efficiency_error"], before["efficiency_error"]
    ):
        yield f"rmse over the bound of {now['name']} went from {before['efficiency']:.3f} to {now['efficiency']:.3f}"
