"""Who does the work: any `concurrent.futures.Executor`; loky's processes by default, a dask cluster where asked."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from pipelines.memory import KEPT, keep_memory
from pipelines.workers import end_with
from toolkit.errors import FitMaterialError, UsageError

THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "VECLIB_MAXIMUM")
ONE_THREAD = {f"{name}{'' if name.endswith('MAXIMUM') else '_NUM'}_THREADS": "1" for name in THREADS}
# loky takes memory that a worker keeps for a leak, says so and begins another worker
NO_LEAK = {"LOKY_MAX_MEMORY_LEAK_SIZE": str(4 * KEPT)}
CONNECT_S = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Crew:
    """`engage(n)` gives an executor of n workers for as long as its context is open; `workers` are engaged at first.

    `restless`: a worker's death breaks the executor and with it all that waits (loky, the standard library); else the
    executor itself moves the work to another worker (dask).
    """

    workers: int
    engage: Callable[[int], AbstractContextManager[Executor]]
    restless: bool = True


def crew(name: str, *, jobs: int | None, version: str) -> Crew:
    """`loky`, or `dask://HOST:PORT`; raises UsageError for another, FitMaterialError where no cluster answers."""
    if name == "loky":
        return Crew(workers=jobs or cores(), engage=loky_processes)
    found = re.fullmatch(r"dask://([\w.-]+|\[[0-9a-fA-F:]+\]):(\d{1,5})", name)
    if found is None:
        raise UsageError(f"--executor: found {name!r}; expected loky or dask://HOST:PORT")
    return dask_cluster(f"tcp://{found[1]}:{found[2]}", jobs=jobs, version=version)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def loky_processes(workers: int) -> Iterator[Executor]:
    """Processes of one thread each, which end with this one; at an error or interrupt they are killed."""
    from loky import ProcessPoolExecutor

    pool = ProcessPoolExecutor(max_workers=workers, timeout=None, initializer=_begin, env=ONE_THREAD | NO_LEAK)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=True, kill_workers=True)
        raise
    pool.shutdown(wait=True)


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    keep_memory()
    end_with(os.getppid())


def dask_cluster(address: str, *, jobs: int | None, version: str) -> Crew:
    """The workers of a running scheduler, one thread each, all of this version."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError("--executor dask:// needs dask.distributed: pip install 'fit-material[cluster]'") from error
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
        client.wait_for_workers(1, timeout=CONNECT_S)
    except (OSError, TimeoutError) as error:
        raise FitMaterialError(
            f"no dask scheduler with workers answers at {address}; expected one: `dask scheduler`, `dask worker`"
        ) from error
    threads = client.nthreads()
    try:
        _refuse_unlike(client.run(_version), threads, version)
    except FitMaterialError:
        client.close()
        raise

    @contextmanager
    def engage(_workers: int) -> Iterator[Executor]:
        try:
            yield client.get_executor(pure=False, retries=0)
        finally:
            client.close()

    return Crew(workers=min(len(threads), jobs or len(threads)), engage=engage, restless=False)


def _version() -> str:
    import toolkit

    return toolkit.__version__


def _refuse_unlike(versions: dict[str, str], threads: dict[str, int], version: str) -> None:
    others = sorted({found for found in versions.values() if found != version})
    if others:
        raise UsageError(f"workers run fit-material {', '.join(others)}, this is {version}; expected one version")
    if any(count != 1 for count in threads.values()):
        raise UsageError("workers of several threads found; expected one each: dask worker --nthreads 1 --nworkers -1")
