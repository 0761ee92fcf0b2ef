"""Work side by side in forks of this process: each finds what it needs where this process holds it, at no cost.

Forks and threads do not mix, so the forks are begun together, with the first job, by a process whose own threads all
wait (OpenCV's survive a fork).
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from typing import Any, ParamSpec, TypeVar

from toolkit.errors import FitMaterialError

from .interrupts import interrupts_held
from .memory import give_back_memory, keep_memory

ALONE = "FIT_MATERIAL_ONE_PROCESS"  # set where the cores are busy with other photographs
Asked = ParamSpec("Asked")
Given = TypeVar("Given")
Argument = TypeVar("Argument")
Job = Callable[..., Any]


def side_by_side(processes: int | None) -> int:
    """How many jobs to do at once: `processes`, or one a core; one where this process may have no forks."""
    if not hasattr(os, "sched_getaffinity"):  # not Linux: system libraries may not survive a fork
        return 1
    if multiprocessing.current_process().daemon or os.environ.get(ALONE):
        return 1
    return processes or len(os.sched_getaffinity(0))


@contextmanager
def workers(count: int) -> Iterator[Workers]:
    """So many workers, until all that is due is done; on an error or an interrupt they end in the midst of it.

    Raises FitMaterialError where one of them is ended by the system.
    """
    crew = Workers(count)
    try:
        yield crew
        crew.end()
    except BaseException as error:
        crew.end(given_up=True)
        if isinstance(error, BrokenProcessPool):
            raise FitMaterialError("a worker died; expected more memory, or a smaller photograph") from error
        raise


class Workers:
    """`count` forks of this process; a single worker is a thread of it.

    What they do is told before the first job is begun; the arguments and what comes of them travel between processes.
    """

    _beginning = threading.Lock()  # held while forks are begun: another thread's are not taken for them

    def __init__(self, count: int) -> None:
        self.count = count
        self._known: list[Job] = []
        self._due: list[Future[Any]] = []
        self._guesses: list[Future[Any]] = []
        self._pool: Executor | None = None
        self._children: set[BaseProcess] = set()

    def learn(self, job: Job) -> None:
        """Tell of a job. Raises RuntimeError where the forks have begun, which would not know it."""
        if self._pool is not None:
            raise RuntimeError("the workers have begun already; tell them of all jobs before the first")
        self._known.append(job)

    def submit(self, job: Callable[Asked, Given], *asked: Asked.args, **more: Asked.kwargs) -> Future[Given]:
        """Begin a job that they have been told of; it is due in the end, unless it is cancelled."""
        future: Future[Given] = self._begin(job, asked, more)
        self._due.append(future)
        return future

    def each(
        self, job: Callable[[Argument], Given], asked: Sequence[Argument], *, guess: bool = False
    ) -> Iterator[tuple[Argument, Given]]:
        """What comes of each argument, as it is there: all are begun at once; by a single worker one by one, in the
        caller's thread, each when it is asked for.

        What is done by a `guess` and never asked for is not waited for.
        """
        if self.count < 2:
            return ((one, job(one)) for one in asked)
        futures: dict[Future[Given], Argument] = {self._begin(job, (one,), {}): one for one in asked}
        (self._guesses if guess else self._due).extend(futures)
        return ((futures[future], future.result()) for future in as_completed(futures))

    def end(self, *, given_up: bool = False) -> None:
        """End them, once all is done that is due, or at once where that is `given_up`.

        Raises BrokenProcessPool where one was ended by the system: whoever asks later cannot know why.
        """
        if self._pool is None:
            return
        if not given_up:
            broken = [one for one in wait(self._due).done if not one.cancelled() and _is_broken(one)]
            if broken:
                broken[0].result()
        if not all(future.done() for future in (*self._due, *self._guesses)):
            self._end_children()
        self._pool.shutdown(wait=given_up, cancel_futures=True)  # nobody waits for forks to tidy up
        for held in (self._known, self._due, self._guesses):  # photographs, in the end
            held.clear()

    def _end_children(self) -> None:
        for child in self._children:
            child.terminate()
        for child in self._children:
            child.join()
        if isinstance(self._pool, ProcessPoolExecutor) and (pipe := self._pool._result_queue):
            # half of what one was sending may be there: this end is the last that its reader waits for
            pipe._writer.close()  # type: ignore[attr-defined]  # no public way leads there

    def _begin(self, job: Job, asked: tuple[Any, ...], more: dict[str, Any]) -> Future[Any]:
        with interrupts_held():  # one that struck between a fork and its entry in the books would leave it running
            if self._pool is None:
                self._pool = self._forks() if self.count > 1 else ThreadPoolExecutor(1)
            if self.count < 2:
                return self._pool.submit(job, *asked, **more)
            return self._pool.submit(_run, self._known.index(job), asked, more)

    def _forks(self) -> Executor:
        give_back_memory()
        begin = partial(_settle_in, os.getpid(), self._known)
        pool = ProcessPoolExecutor(self.count, mp_context=get_context("fork"), initializer=begin)
        with self._beginning:
            others = set(multiprocessing.active_children())
            pool.submit(os.getpid)  # all are forked with the first job
            self._children = set(multiprocessing.active_children()) - others
        return pool


_known: list[Job] = []  # in a fork, what it was begun with


def _run(number: int, asked: tuple[Any, ...], more: dict[str, Any]) -> object:
    return _known[number](*asked, **more)


def _is_broken(future: Future[Any]) -> bool:
    return isinstance(future.exception(), BrokenProcessPool)


def _settle_in(parent: int, known: list[Job]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # interrupts are the parent's to answer
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    end_with(parent)
    keep_memory()
    _known[:] = known


def end_with(parent: int) -> None:
    """Let this process end soon after the one that began it: nothing may go on writing while a new run begins."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
