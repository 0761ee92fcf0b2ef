"""A stand-in for the main job that takes milliseconds: all that surrounds it (workers, files, journal) is real.

`PLAN` in the environment is a folder: `log` gets a line as each fit begins and ends, `die-NAME` kills the worker that
begins NAME, `sleep` holds how long a fit takes.
"""

from __future__ import annotations

import functools
import hashlib
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.batch.job import Job, Outcome
from pipelines.settings import Settings
from tests.pipelines import fakes
from toolkit.errors import BadInputError
from toolkit.records import MaterialReport

PLAN = "FIT_MATERIAL_TEST_PLAN"
KEPT = (".json", ".settings")


@functools.cache
def whole_report() -> MaterialReport:
    """One report for all fits."""
    report = fakes.report(width_px=96, height_px=72, draws=20)
    return replace(report, fits=report.fits[:2])


def fake_jointly(asked: Sequence[tuple[Path, Settings]], **_: Any) -> MaterialReport:
    """The first one's report, of several once each was begun."""
    reports = [fake_fit(path) for path, _ in asked]
    return reports[0]


def fake_fit(path: Path) -> MaterialReport:
    """A report that depends on the photograph's bytes alone."""
    plan = Path(os.environ[PLAN])
    log(plan, f"begin {path.name}")
    if (plan / f"die-{path.name}").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    if (plan / "sleep").exists():
        time.sleep(float((plan / "sleep").read_text()))
    data = path.read_bytes()
    if data.startswith(b"bad"):
        told = data.decode("utf-8", "surrogateescape") if b"hostile" in data else "found a bad photograph"
        raise BadInputError(f"{path.name}: {told}; expected a good one")
    report = varied(whole_report(), int.from_bytes(hashlib.sha256(data).digest()[:4]) / 2**32)
    log(plan, f"end {path.name}")
    text = data.decode("utf-8", "surrogateescape")
    metadata = replace(report.image.metadata, make=text, model=text, lens=text)
    image = replace(report.image, name=path.name, sha256=hashlib.sha256(data).hexdigest(), metadata=metadata)
    return replace(report, image=image, seconds={})


def varied(report: MaterialReport, share: float) -> MaterialReport:
    """The same material, a little different each time: `share` 0 .. 1 moves every estimate by up to 2 sd."""
    fits = []
    for fit in report.fits:
        moved = [
            replace(one, estimate=one.estimate + 2 * (2 * share - 1) * one.sd)  # type: ignore[operator]  # numbers
            for one in fit.parameters
        ]
        fits.append(replace(fit, parameters=tuple(moved)))
    return replace(report, fits=tuple(fits))


def log(plan: Path, line: str) -> None:
    handle = os.open(plan / "log", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    try:
        os.write(handle, f"{line}\n".encode())
    finally:
        os.close(handle)


def work(job: Job) -> Outcome:
    """What a worker does, the fit faked and the slow files left out."""
    import pipelines.fit_material
    from pipelines.batch.one import fit_one
    from pipelines.report import write

    pipelines.fit_material.fit_jointly = fake_jointly
    original = write._writers
    if not hasattr(original, "faked"):

        def few(*a: Any, **k: Any) -> dict[str, Any]:
            return {name: to for name, to in original(*a, **k).items() if name.startswith(KEPT)}

        few.faked = True  # type: ignore[attr-defined]  # so that a worker wraps it once
        write._writers = few
    return fit_one(job)
