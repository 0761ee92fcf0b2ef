"""A validation as others read it: the JSON object, the CSV table, and what changed since the last record."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit import __version__
from toolkit.errors import BadInputError

from .score import Score

SCHEMA = "fit-material/validation/1"
MAX_BYTES = 1 << 22
WORSE_SDS = 3.0  # of a figure's own error by chance, from which a change for the worse is real
WORSE_DB = 1.0
COLUMNS = (
    "number,model,diffuse,broken,amount,status,parameter,channel,truth,mean,sd,rank,bound_sd,psnr_db,chi2_reduced,flags"
)


def outcome(found: Score, *, seconds: float, trials: str) -> dict[str, Any]:
    """What `--json` prints and the record keeps."""
    return {
        "schema": SCHEMA,
        "version": __version__,
        "trials": trials,
        "renders": found.renders,
        "verdict": found.verdict,
        "good": not found.complaints,
        "complaints": list(found.complaints),
        "coverage": {f"{level:g}": share for level, share in found.coverage.items()},
        "coverage_error": found.coverage_error,
        "efficiency": found.efficiency,
        "efficiency_error": found.efficiency_error,
        "mean_z2": found.mean_z2,
        "psnr_db": float(sorted(found.psnr_db)[len(found.psnr_db) // 2]) if len(found.psnr_db) else None,
        "false_alarms": found.false_alarms,
        "parameters": [
            {
                "model": g.model,
                "parameter": g.name,
                "renders": g.count,
                "coverage": {f"{level:g}": share for level, share in g.coverage.items()},
                "mean_z": g.mean_z,
                "mean_z2": g.mean_z2,
                "rank_p": g.rank_p,
                "relative_rmse": g.relative_rmse,
                "rmse": g.unit_rmse,
                "efficiency": g.efficiency,
            }
            for g in found.groups
        ],
        "stress": [
            {
                "assumption": s.name,
                "amount": s.amount,
                "renders": s.count,
                "largest_shift_sd": s.shift,
                "largest_shift_relative": s.relative,
                "outside": s.outside,
                "flagged": s.flagged,
                "silent": s.silent,
                "flags": list(s.flags),
            }
            for s in found.stress
        ],
        "failures": [dict(line) for line in found.failures],
        "seconds": seconds,
    }


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
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise BadInputError(
            f"{path} holds no validation record; expected the validation.json of an earlier run"
        ) from error
    return record  # type: ignore[no-any-return]  # its schema is checked, its numbers where they are used


def worse(now: Mapping[str, Any], before: Mapping[str, Any]) -> list[str]:
    """What changed for the worse by more than chance, in words; empty where nothing did."""
    said = []
    off, was = (abs(float(one["coverage"]["0.9"]) - 0.9) for one in (now, before))
    error = float((now["coverage_error"] ** 2 + before["coverage_error"] ** 2) ** 0.5)
    if off - was > WORSE_SDS * error:
        said.append(f"coverage of 90 % intervals went from {_percent(before)} to {_percent(now)}")
    error = float((now["efficiency_error"] ** 2 + before["efficiency_error"] ** 2) ** 0.5)
    if now["efficiency"] - before["efficiency"] > WORSE_SDS * error:
        said.append(f"rmse over the bound went from {before['efficiency']:.3f} to {now['efficiency']:.3f}")
    if len(now["failures"]) > len(before["failures"]):
        said.append(f"failures went from {len(before['failures'])} to {len(now['failures'])}")
    if now["psnr_db"] is not None and before["psnr_db"] is not None and now["psnr_db"] < before["psnr_db"] - WORSE_DB:
        said.append(f"the diffuse layer's PSNR went from {before['psnr_db']:.1f} to {now['psnr_db']:.1f} dB")
    silent = {(s["assumption"], s["amount"]) for s in before["stress"] if s["silent"] > 0.1}
    said += [
        f"{s['assumption']} {s['amount']:g} now misleads without an alarm"
        for s in now["stress"]
        if s["silent"] * s["renders"] >= 2 and s["silent"] > 0.1 and (s["assumption"], s["amount"]) not in silent
    ]
    return said


def _percent(one: Mapping[str, Any]) -> str:
    return f"{100 * one['coverage']['0.9']:.1f} %"
