"""Memory that is kept is not taken from the system again, and the system's own way is a fallback, no error."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

from pipelines import memory

FAULTS = """
import resource, sys
import numpy as np
from pipelines.memory import keep_memory
kept = keep_memory() if sys.argv[1] == "kept" else False
def work():
    for _ in range(50):
        sum([np.ones(80_000) for _ in range(20)])
work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are the GNU C library's")
def test_a_process_that_keeps_its_memory_takes_each_page_once() -> None:
    """The second time the same arrays cost no page faults; by the library's own settings tens of thousands."""
    found = {}
    for way in ("kept", "plain"):
        run = subprocess.run([sys.executable, "-c", FAULTS, way], capture_output=True, text=True, check=True)
        kept, faults = run.stdout.split()
        found[way] = int(faults)
        assert (kept == "True") <= (way == "kept")
    assert found["kept"] < 500 < 20_000 < found["plain"]


COPIES = """
import os, resource, sys
import numpy as np
from pipelines.memory import give_back_memory, keep_memory
def work():
    sum([np.ones(80_000) for _ in range(50)])
keep_memory()
work()
if sys.argv[1] == "given back":
    give_back_memory()
begin, end = os.pipe()
child = os.fork()
if child == 0:
    os.read(begin, 1)
    os._exit(0)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
os.write(end, b"!")
os.waitpid(child, 0)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are the GNU C library's")
def test_free_memory_that_is_given_back_is_not_copied_while_a_fork_lives() -> None:
    """Else the system copies each page of it at its first write, since the fork shares it."""
    ways = ("kept", "given back")
    runs = [subprocess.run([sys.executable, "-c", COPIES, way], capture_output=True, check=True) for way in ways]
    kept, given_back = (int(run.stdout) for run in runs)
    assert given_back < kept / 4


def test_another_c_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is called of it."""
    monkeypatch.setattr(platform, "libc_ver", lambda: ("", ""))
    monkeypatch.setattr(memory, "ctypes", None)
    assert memory.keep_memory() is False
    memory.give_back_memory()
