"""Work side by side in forks: what they know, what is waited for, and how they end."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from concurrent.futures import Future
from pathlib import Path

import pytest

from pipelines.workers import ALONE, Workers, side_by_side, workers
from toolkit.errors import FitMaterialError

LONG_S = 60.0


def ended(before: set[multiprocessing.process.BaseProcess]) -> bool:
    """Whether all children begun since have ended, within a time that no idle machine needs."""
    children = set(multiprocessing.active_children()) - before
    for child in children:
        child.join(LONG_S)
    return all(child.exitcode is not None for child in children)


@pytest.mark.parametrize("count", [1, 2])
def test_workers_find_what_this_process_holds(count: int) -> None:
    """A job may be what cannot be sent; its arguments and what comes of it are."""
    held = threading.Lock()  # not to be pickled
    with workers(count) as crew:

        def job(one: int, *, more: int = 0) -> tuple[int, bool]:
            return one + more, held.locked()

        crew.learn(job)
        assert crew.submit(job, 1, more=2).result() == (3, False)
        assert sorted(crew.each(job, [1, 2, 3])) == [(1, (1, False)), (2, (2, False)), (3, (3, False))]


def test_one_worker_is_this_process_and_begins_what_is_asked_for() -> None:
    """A guess that nobody asks for costs nothing then."""
    begun: list[int] = []
    before = set(multiprocessing.active_children())

    def job(one: int) -> int:
        begun.append(one)
        return os.getpid()

    with workers(1) as crew:
        crew.learn(job)
        crew.each(job, [1, 2], guess=True)
        assert [pid for _, pid in crew.each(job, [3])] == [os.getpid()]
        assert crew.submit(job, 4).result() == os.getpid()
    assert begun == [3, 4]
    assert set(multiprocessing.active_children()) <= before


def test_forks_cannot_be_told_of_a_job_too_late() -> None:
    """They would not find it; a single worker is told the same, so that nothing works there alone."""
    for count in (1, 2):
        with workers(count) as crew:
            crew.learn(os.getpid)
            crew.submit(os.getpid).result()
            with pytest.raises(RuntimeError, match="begun already"):
                crew.learn(time.sleep)


@pytest.mark.parametrize("count", [1, 2])
def test_what_is_due_is_done_in_the_end(tmp_path: Path, count: int) -> None:
    """Also where nobody asks for what comes of it."""

    def job() -> None:
        time.sleep(0.2)
        (tmp_path / "done").touch()

    with workers(count) as crew:
        crew.learn(job)
        crew.submit(job)
    assert (tmp_path / "done").exists()


def test_a_guess_is_not_waited_for() -> None:
    """Its fork ends, and what is due beside it is done."""
    before = set(multiprocessing.active_children())
    with workers(2) as crew:
        crew.learn(time.sleep)
        crew.learn(os.getpid)
        crew.each(time.sleep, [600.0], guess=True)
        assert crew.submit(os.getpid).result() != os.getpid()
    assert ended(before)


def test_an_error_ends_all_in_the_midst_of_their_work() -> None:
    """What waits for them is told."""
    before, futures = set(multiprocessing.active_children()), list[Future[None]]()

    def interrupted() -> None:
        with workers(2) as crew:
            crew.learn(time.sleep)
            futures.extend(crew.submit(time.sleep, 600.0) for _ in range(8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert ended(before)
    assert all(future.done() for future in futures)


SENDING = """
import multiprocessing, os, struct, sys, time
from pipelines.workers import workers
def quick(): return 1
def half(told):
    pipe = multiprocessing.current_process()._args[1]._writer  # by which it sends what comes of its work
    os.write(pipe.fileno(), struct.pack("!i", 1000) + b"not a thousand bytes")
    os.write(told, b"!")
    time.sleep(600.0)
try:
    with workers(2) as crew:
        crew.learn(half)
        crew.learn(quick)
        there, told = os.pipe()
        crew.submit(quick).result()
        crew.each(half, [told], guess=True)
        os.read(there, 1)
        if sys.argv[1] == "error":
            raise KeyboardInterrupt
except KeyboardInterrupt:
    pass
print("ended", flush=True)
"""


@pytest.mark.parametrize("how", ["error", "whole"])
def test_a_fork_that_is_ended_while_it_sends_is_not_waited_for(how: str) -> None:
    """The rest of it would be read for ever, and this process not end."""
    command = [sys.executable, "-c", SENDING, how]
    run = subprocess.run(command, capture_output=True, text=True, timeout=LONG_S, check=True)
    assert run.stdout == "ended\n"


def test_an_interrupt_while_they_end_ends_them_too() -> None:
    """It comes while the last jobs are waited for."""
    before = set(multiprocessing.active_children())

    def strike(*_: object) -> None:
        raise KeyboardInterrupt

    def waited_for() -> None:
        with workers(2) as crew:
            crew.learn(time.sleep)
            crew.submit(time.sleep, 600.0)
            signal.setitimer(signal.ITIMER_REAL, 0.5)

    handler = signal.signal(signal.SIGALRM, strike)
    try:
        with pytest.raises(KeyboardInterrupt):
            waited_for()
    finally:
        signal.signal(signal.SIGALRM, handler)
    assert ended(before)


@pytest.mark.parametrize("asked", [True, False])
def test_a_fork_that_the_system_ends_is_told_in_one_line(*, asked: bool) -> None:
    """As where memory runs out; whether somebody asks for what it was to do or not."""

    def die() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    def killed() -> None:
        with workers(2) as crew:
            crew.learn(die)
            future = crew.submit(die)
            if asked:
                future.result()

    with pytest.raises(FitMaterialError, match="memory"):
        killed()


ORPHANS = """
import os, time
from pipelines.workers import workers
with workers(2) as crew:
    crew.learn(os.getpid)
    crew.learn(time.sleep)
    print(crew.submit(os.getpid).result(), flush=True)
    crew.submit(time.sleep, 600.0).result()
"""


def test_forks_end_with_their_parent() -> None:
    """One that is killed outright leaves none behind that could still write."""
    with subprocess.Popen([sys.executable, "-c", ORPHANS], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        fork = int(parent.stdout.readline())
        parent.kill()
    until = time.monotonic() + LONG_S
    while Path(f"/proc/{fork}/stat").exists() and time.monotonic() < until:
        if Path(f"/proc/{fork}/stat").read_text().split(")")[1].split()[0] == "Z":
            break
        time.sleep(0.05)
    else:
        assert not Path(f"/proc/{fork}").exists()


def test_crews_of_two_threads_leave_each_other_alone() -> None:
    """Each knows its own jobs, and the end of one is no end of the other."""

    def ten() -> int:
        return 10

    with workers(2) as one:
        one.learn(ten)
        assert one.submit(ten).result() == 10
        with workers(2) as other:
            other.learn(os.getpid)
            other.learn(time.sleep)
            other.each(time.sleep, [600.0], guess=True)
            assert other.submit(os.getpid).result() != os.getpid()
            assert one.submit(ten).result() == 10
        assert one.submit(ten).result() == 10


def test_a_single_worker_ends_with_the_job_in_hand_on_an_error() -> None:
    """A thread cannot be ended; what it has not begun is not begun any more."""
    begun, futures = threading.Event(), list[Future[None]]()

    def job() -> None:
        begun.set()
        time.sleep(0.2)

    def interrupted() -> None:
        with workers(1) as crew:
            crew.learn(job)
            futures.extend(crew.submit(job) for _ in range(3))
            assert begun.wait(LONG_S)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [future.cancelled() for future in futures] == [False, True, True]


def test_workers_that_were_asked_for_nothing_were_never_begun() -> None:
    """An image without a ball is told of before anything is forked."""
    crew = Workers(2)
    before = set(multiprocessing.active_children())
    crew.end()
    assert set(multiprocessing.active_children()) <= before


def test_one_job_at_a_time_where_other_photographs_keep_the_cores_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever was asked for."""
    monkeypatch.delenv(ALONE, raising=False)
    assert side_by_side(3) == 3
    assert side_by_side(None) >= 1
    monkeypatch.setenv(ALONE, "1")
    assert side_by_side(3) == side_by_side(None) == 1


def test_workers_that_have_ended_hold_nothing() -> None:
    """A job's owner often has the crew, too: a photograph would stay until the collector of such circles comes by."""

    class Owner:
        def __init__(self, crew: Workers) -> None:
            self.crew = crew
            crew.learn(self.job)

        def job(self) -> int:
            return os.getpid()

    gc.disable()
    try:
        with workers(2) as crew:
            owner = Owner(crew)
            crew.submit(owner.job).result()
        gone = weakref.ref(owner)
        del owner
        assert gone() is None
    finally:
        gc.enable()
