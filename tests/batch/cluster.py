"""A dask cluster of this machine's own: what `dask scheduler` and `dask worker` start, on loopback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def cluster(folder: Path, *, threads_each: int = 1) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """A scheduler and two worker processes on loopback, nothing else listening."""
    environment = {
        **os.environ,
        "DASK_DISTRIBUTED__WORKER__DAEMON": "false",
        "DASK_TEMPORARY_DIRECTORY": str(folder),
    }
    home = Path(__file__).resolve().parents[2]

    def start(*words: str) -> subprocess.Popen[str]:
        module = {"scheduler": "dask_scheduler", "worker": "dask_worker"}[words[0]]
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{module}", *words[1:]],
            cwd=home,
            env=environment,
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        )

    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    workers: list[subprocess.Popen[str]] = []
    try:
        assert scheduler.stderr is not None
        address = next(found[1] for line in scheduler.stderr if (found := re.search(r"tcp://(127\.0\.0\.1:\d+)", line)))
        plain = ("--nthreads", str(threads_each), "--no-nanny", "--no-dashboard", "--local-directory", str(folder))
        workers = [start("worker", address, "--host", "127.0.0.1", *plain) for _ in range(2)]
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
            if process.stderr is not None:
                process.stderr.close()
