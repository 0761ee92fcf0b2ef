"""Many files through few decoders' processes: a worker decodes one after the other and is replaced when it dies.

The decoding itself, its limits and its checks are the product's; only the fresh process for each file is spared.
Run as a script: the worker. It reads paths, one a line, and answers one JSON line each.
"""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of one file: `error` is empty where it decoded; `died` where the worker did not survive it."""

    path: Path
    error: str
    shape: tuple[int, ...]
    digest: str
    cpu_s: float
    peak_bytes: int
    died: bool


def sweep(paths):
    """The outcome of each path, in order."""
    outcomes = []
    while len(outcomes) < len(paths):
        outcomes += _one_worker(paths[len(outcomes) :])
    return outcomes


def _one_worker(paths):
    """Outcomes up to and with the file that kills the worker."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.io.sweep"],
        input="".join(f"{path}\n" for path in paths),
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).resolve().parents[2],
    )
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    outcomes = [Outcome(path=Path(p), died=False, **answer) for p, answer in zip(paths, found, strict=False)]
    if len(outcomes) < len(paths):
        last = Path(paths[len(outcomes)])
        nothing = {"error": f"died: {done.stderr[-200:]}", "shape": (), "digest": "", "cpu_s": 0.0, "peak_bytes": 0}
        outcomes.append(Outcome(path=last, died=True, **nothing))
    return outcomes


def _worker():
    import hashlib
    import signal
    import time

    from toolkit.errors import BadInputError
    from toolkit.io.child import limit_process
    from toolkit.io.decoded import Limits
    from toolkit.io.read import read_in_process

    limit_process(Limits(cpu_s=1e6), 10 << 20)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        signal.alarm(10)  # its default action ends the worker, whatever the decoder does
        start, error, shape, digest = time.process_time(), "", (), ""
        try:
            values = read_in_process(line.rstrip("\n")).values
            shape, digest = values.shape, hashlib.sha256(values.tobytes()).hexdigest()
        except BadInputError as caught:
            error = str(caught)
        spent = time.process_time() - start
        peak = peak_bytes()
        answer = {"error": error, "shape": shape, "digest": digest, "cpu_s": spent, "peak_bytes": peak}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def peak_bytes() -> int:
    """The most memory this process has held since it began; getrusage would count its parent's before the fork."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(re.search(r"VmHWM:\s+(\d+) kB", status.read_text())[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    _worker()
