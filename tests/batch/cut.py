"""A batch that is killed again and again at random moments, then let run to its end: `python -m tests.batch.cut`.

One process forks each attempt, so that an attempt begins in milliseconds; it prints a JSON report of what it saw.
"""

from __future__ import annotations

import fcntl
import json
import multiprocessing
import os
import random
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from pipelines.batch.crew import Crew, _begin, loky_processes
from pipelines.batch.journal import NAME

from . import fake, shoots

WORKERS = 2
MOST_FITS = 4  # that an attempt gets to make before the moment comes
MOMENT_S = 0.1  # longer than anything between two fits takes


@contextmanager
def forks(workers: int) -> Iterator[Executor]:
    """The standard library's pool, forked."""
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin) as pool:
        yield pool


CREWS = {"forks": Crew(workers=WORKERS, engage=forks), "loky": Crew(workers=WORKERS, engage=loky_processes)}


def attempt(source: Path, out: Path, crew: Crew) -> None:
    """One run of the batch, from where the last one left it."""
    begun = (out / NAME).exists()
    shoots.run(source, out, crew, resume=begun, overwrite=not begun)


def cut(source: Path, out: Path, plan: Path, crew: Crew, times: int, seed: int) -> dict[str, int]:
    """Kill `times` attempts, each with all its processes, at random moments: soon after as many fits as chance says;
    or, where the last attempt began none, later, since the page may be what is missing.
    """
    rng = random.Random(seed)  # noqa: S311  # moments, no secrets
    seen = {"torn": 0, "lost": 0, "twice": 0, "killed": 0, "begun": 0}
    fresh = ["the first"]
    for _ in range(times):
        noted = done(out)
        before = len(lines(plan))
        child = os.fork()
        if child == 0:
            os.setsid()
            attempt(source, out, crew)
            os._exit(0)
        fits, longest_s = (rng.randint(0, MOST_FITS), MOMENT_S) if fresh else (0, 5 * MOMENT_S)
        wait_for(child, plan, len(ended(plan)) + fits)
        time.sleep(rng.uniform(0.0, longest_s))
        seen["killed"] += kill(child)
        released(out)
        fresh = [line.removeprefix("begin ") for line in lines(plan)[before:] if line.startswith("begin ")]
        seen["begun"] += len(fresh)
        seen["twice"] += sum(name in noted for name in fresh)
        seen["torn"] += torn(out)
        seen["lost"] += sum(not found for found in done(out).values())
    return seen


def wait_for(child: int, plan: Path, count: int) -> None:
    """Until so many fits have ended, or the process is at its end."""
    while len(ended(plan)) < count and os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        time.sleep(0.001)


def kill(child: int) -> bool:
    """End a whole process group at once; False where it had come to its end before."""
    ended, _ = os.waitpid(child, os.WNOHANG)
    if ended:
        return False
    try:
        os.killpg(child, signal.SIGKILL)
    except ProcessLookupError:  # killed before it led a group of its own
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def released(out: Path) -> None:
    """Wait for the journal's lock: its holders, forked workers among them, are dead then."""
    if (out / NAME).exists():
        with (out / NAME).open("rb") as held:
            fcntl.flock(held, fcntl.LOCK_EX)


def lines(plan: Path) -> list[str]:
    return (plan / "log").read_text().splitlines() if (plan / "log").exists() else []


def ended(plan: Path) -> list[str]:
    return [line for line in lines(plan) if line.startswith("end ")]


def done(out: Path) -> dict[str, bool]:
    """Photographs that the journal says are done, and whether their result is there."""
    found = {}
    for line in (out / NAME).read_bytes().splitlines() if (out / NAME).exists() else ():
        try:
            entry = json.loads(line)
        except ValueError:
            continue  # torn: the only file that may be, and only in its last line
        if entry.get("status") == "done":
            name = Path(entry["place"]).name.removesuffix(".fit")
            found[f"{name}.dng"] = (out / entry["place"] / f"{name}.json").is_file()
    return found


def torn(out: Path) -> int:
    """How many visible files are not whole."""
    bad = 0
    for path in out.rglob("*.json"):
        if ".part" in str(path):
            continue
        try:
            json.loads(path.read_bytes())
        except ValueError:
            bad += 1
    return bad


def main() -> None:
    """SOURCE OUT CREW TIMES SEED; the plan's folder comes by the environment, as for every fake fit."""
    source, out, crew = Path(sys.argv[1]), Path(sys.argv[2]), CREWS[sys.argv[3]]
    times, seed = int(sys.argv[4]), int(sys.argv[5])
    plan = Path(os.environ[fake.PLAN])
    warm = plan / "warm"
    shoots.run(shoots.shoot(warm / "shoot", 1), warm / "out")  # whatever is imported later is imported now
    (plan / "log").unlink()
    seen = cut(source, out, plan, crew, times, seed)
    before = len([line for line in lines(plan) if line.startswith("begin ")])
    attempt(source, out, crew)
    seen["last"] = len([line for line in lines(plan) if line.startswith("begin ")]) - before
    print(json.dumps(seen))  # noqa: T201  # read by the test


if __name__ == "__main__":
    main()
