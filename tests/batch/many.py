"""A batch of many photographs as a process, `python -m tests.batch.many SOURCE OUT`: its peak memory, MiB."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

from pipelines.batch.crew import Crew, loky_processes

from . import fake, shoots

if __name__ == "__main__":
    source, out = Path(sys.argv[1]), Path(sys.argv[2])
    shoots.run(source, out, Crew(workers=2, engage=loky_processes), work=fake.work, parquet=True)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10)  # noqa: T201  # read by the test
