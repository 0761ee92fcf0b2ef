"""Every job done once, by whoever is engaged; a worker that dies takes down at most the photograph that killed it."""

from __future__ import annotations

import re
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import replace
from pathlib import Path

from toolkit.errors import FitMaterialError

from .crew import Crew
from .job import Job, Outcome

Work = Callable[[Job], Outcome]
Ended = Callable[[Job, Outcome], None]
AHEAD = 2  # jobs handed out for each worker: one in its hands, one to follow without a pause
MOST_DEATHS_AT_START = 3


def run(jobs: Sequence[Job], crew: Crew, work: Work, *, ended: Ended, note: Callable[[str], None]) -> None:
    """Do all jobs; `ended` is told of each in the order in which they end, `note` of workers that die.

    Where the executor breaks, the jobs that were in a worker's hands are suspects and run again alone, one after
    another; the others go on. Raises FitMaterialError where workers die before they begin.
    """
    waiting = deque(jobs)
    suspects: list[Job] = []
    idle_deaths = 0
    with tempfile.TemporaryDirectory(prefix="fit-material-") as folder:
        beacons = Path(folder) if crew.restless else None
        while waiting:
            before = len(waiting)
            suspects += _together(waiting, crew, work, ended, note, beacons)
            idle_deaths = idle_deaths + 1 if len(waiting) == before else 0
            if idle_deaths >= MOST_DEATHS_AT_START:
                raise FitMaterialError("workers die before they begin; expected more memory, or fewer --jobs")
        _alone(deque(suspects), crew, work, ended)


def _together(
    waiting: deque[Job], crew: Crew, work: Work, ended: Ended, note: Callable[[str], None], beacons: Path | None
) -> list[Job]:
    """Work on what waits until all is done or the executor breaks; the suspects then."""
    out: dict[Future[Outcome], Job] = {}
    why = ""
    with crew.engage(crew.workers) as executor:
        while (waiting or out) and not why:
            while waiting and len(out) < AHEAD * crew.workers and not why:
                job = replace(waiting.popleft(), beacon=beacons)
                why = _submit(executor, work, job, out, waiting)
            over = wait(out, return_when=FIRST_COMPLETED).done if out else set()
            for future in [one for one in out if one in over]:  # of several that ended, as they were handed out
                job = out.pop(future)
                outcome = _outcome(future, job)
                if isinstance(outcome, str):
                    why = outcome
                    waiting.appendleft(job)
                else:
                    ended(job, outcome)
        broken = [job for future, job in out.items() if not _told(future, job, ended)]
    waiting.extendleft(reversed(broken))
    return _suspects(waiting, beacons, why, note) if why else []


def _submit(executor: Executor, work: Work, job: Job, out: dict[Future[Outcome], Job], waiting: deque[Job]) -> str:
    """Hand a job out; why the executor cannot take it, where it broke meanwhile."""
    try:
        out[executor.submit(work, job)] = job
    except BrokenExecutor as error:
        waiting.appendleft(job)
        return str(error) or type(error).__name__
    return ""


def _outcome(future: Future[Outcome], job: Job) -> Outcome | str:
    """What a future brought; a text where the executor broke and the job may be innocent."""
    try:
        return future.result()
    except BrokenExecutor as error:
        return str(error) or type(error).__name__
    except (Exception, CancelledError) as error:  # the executor gave this one up: a worker died under it repeatedly
        reason = f"{type(error).__name__}: {error}".partition("\n")[0][:200]
        return Outcome(number=job.number, status="failed", error=f"its worker was lost ({reason})", code=1)


def _told(future: Future[Outcome], job: Job, ended: Ended) -> bool:
    """Whether a future of a broken executor had its outcome all the same; then it is told."""
    if not future.done() or future.cancelled() or future.exception() is not None:
        return False
    ended(job, future.result())
    return True


def _suspects(waiting: deque[Job], beacons: Path | None, why: str, note: Callable[[str], None]) -> list[Job]:
    """Take out of the waiting what was in a worker's hands when one died."""
    lit = {int(path.name) for path in beacons.iterdir()} if beacons is not None else set()
    for number in lit:
        Path(f"{beacons}/{number}").unlink(missing_ok=True)
    suspects = [job for job in waiting if job.number in lit]
    for job in suspects:
        waiting.remove(job)
    names = ", ".join(job.name for job in suspects) or "none"
    note(f"a worker died ({obituary(why)}); in hand were {names}: to be fitted again, alone")
    return suspects


def _alone(suspects: deque[Job], crew: Crew, work: Work, ended: Ended) -> None:
    """One worker, one job at a time: who dies now has himself to blame."""
    while suspects:
        with crew.engage(1) as executor:
            while suspects:
                job = replace(suspects.popleft(), beacon=None)
                try:
                    outcome = executor.submit(work, job).result()
                except BrokenExecutor as error:
                    text = f"its worker died ({obituary(str(error))}), also alone; expected a smaller photograph"
                    ended(job, Outcome(number=job.number, status="failed", error=f"{text} or more memory", code=1))
                    break
                ended(job, outcome)


def obituary(why: str) -> str:
    """The exit codes of dead workers, where the executor tells them."""
    found = re.search(r"exit codes? of the workers? (?:are|is) \{?([^}\n]*)\}?", why)
    return found[1].strip() if found else "no exit code is known"
