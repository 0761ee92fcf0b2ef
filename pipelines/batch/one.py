"""What a worker does: one fit, whole, in one thread; nothing of it can stop another."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from pipelines.files import digest_of
from pipelines.report.stored import read_result
from pipelines.report.text import stem
from pipelines.told import in_one_line
from toolkit.errors import BadInputError, FitMaterialError

from .card import SUFFIX, read_card, write_card
from .job import Job, Outcome, digest_of_all, settings_digest
from .places import inside

if TYPE_CHECKING:
    from pipelines.report.write import Write
    from toolkit.records import MaterialReport


def fit_one(job: Job) -> Outcome:
    """Make one fit and write its result, or find that this was done before; never raises but for interrupts."""
    begin = time.perf_counter()
    try:
        with _beacon(job):
            return _fit_one(job, begin)
    except Exception as error:  # one photograph's failure must not stop the others
        return failure(job.number, error)


def failure(number: int, error: BaseException, *, digest: str = "") -> Outcome:
    """How a photograph ended whose fit raised."""
    foreseen = isinstance(error, FitMaterialError)
    code = error.exit_code if isinstance(error, FitMaterialError) else 1
    text = in_one_line(error) if isinstance(error, Exception) else type(error).__name__
    lasting = foreseen and isinstance(error, BadInputError) and bool(digest)
    return Outcome(number=number, status="failed", error=text, code=code, input=digest, lasting=lasting)


def _fit_one(job: Job, begin: float) -> Outcome:
    for image, _ in job.asked:
        if not image.is_file():
            kind = "is a folder" if image.is_dir() else "does not exist"
            raise BadInputError(f"{image} {kind}; expected an image file")
    key = key_of(job)
    before = _before(job, key) if job.resume else None
    if before is not None:
        return before
    try:
        return _made(job, key, begin)
    except FitMaterialError as error:
        return failure(job.number, error, digest=key["input"])


def key_of(job: Job) -> dict[str, str]:
    """Of which photographs, settings and version a result is."""
    settings = settings_digest(job.asked, page=job.page, exports=job.exports)
    return {"input": digest_of_all([path for path, _ in job.asked]), "settings": settings, "version": job.version}


def _before(job: Job, key: Mapping[str, str]) -> Outcome | None:
    """What was done of it before: a whole result of this very key, or a failure that would come again.

    Raises BadInputError where the photograph is not the one that was fitted.
    """
    known = job.before or {}
    if known.get("input") not in (None, "", key["input"]):
        raise BadInputError(f"{job.name} has changed since it was fitted; expected --overwrite to fit all anew")
    if known.get("status") == "failed" and known.get("lasting"):
        code = known.get("code")
        text = str(known.get("error"))
        return Outcome(
            number=job.number,
            status="failed",
            error=text,
            code=code if isinstance(code, int) else 1,
            input=key["input"],
            result=str(known.get("result") or ""),
            lasting=True,
        )
    result = result_of(job)
    card = read_card(result.with_name(result.name.removesuffix(".json") + SUFFIX))
    if not result.is_file() or {name: card.get(name) for name in key} != dict(key):
        return None
    digest = digest_of(result)
    if known.get("status") == "done" and known.get("result") != digest:
        return None  # touched since
    return _judged(job, key, "kept", digest, 0.0)


def result_of(job: Job) -> Path:
    """STEM.json of a job; raises BadInputError where that would lie outside the batch's folder."""
    return inside(job.out, PurePosixPath(job.place)) / f"{stem(job.asked[0][0].name)}.json"


def _made(job: Job, key: Mapping[str, str], begin: float) -> Outcome:
    from pipelines.run import run
    from pipelines.threads import one_thread_each

    def card(report: MaterialReport) -> dict[str, Write]:
        return {SUFFIX: partial(write_card, report=report, key=key)}

    result = result_of(job)
    with one_thread_each():
        run(job.asked, job.out / job.place, page=job.page, exports=job.exports, processes=1, beside=card)
    return _judged(job, key, "done", digest_of(result), time.perf_counter() - begin)


def _judged(job: Job, key: Mapping[str, str], status: str, digest: str, seconds: float) -> Outcome:
    """A result with an error in it (the best fit did not converge) is there, and has failed."""
    error = read_result(result_of(job)).get("error")
    return Outcome(
        number=job.number,
        status="failed" if error else ("kept" if status == "kept" else "done"),
        error=str(error or ""),
        code=1 if error else 0,
        input=key["input"],
        result=digest,
        lasting=bool(error),
        seconds=seconds,
    )


@contextlib.contextmanager
def _beacon(job: Job) -> Iterator[None]:
    """While a worker is at a photograph a small file says so; it outlives the worker that dies."""
    if job.beacon is None:
        yield
        return
    path = job.beacon / str(job.number)
    path.touch()
    yield
    path.unlink(missing_ok=True)
