"""Whoever does the work: a worker that dies is named, the innocent run again, the guilty fails alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import toolkit
from pipelines.batch.crew import Crew, crew, loky_processes
from pipelines.batch.one import fit_one
from pipelines.layers import resolve
from synthetic.photograph import render_photograph
from tests.inference.ball import NOISE, glossy, scene_of
from toolkit.errors import FitMaterialError, UsageError

from . import shoots
from .cluster import cluster
from .cut import CREWS, lines

REAL = 40
LOKY = Crew(workers=2, engage=loky_processes)


@pytest.mark.parametrize("name", ["loky", "forks"])
def test_a_photograph_that_kills_its_worker_fails_and_no_other(tmp_path: Path, plan: Path, name: str) -> None:
    """It is named with the signal where the executor tells it; its neighbours run again and are done."""
    source, out, notes = shoots.shoot(tmp_path / "shoot", 8), tmp_path / "out", []
    (plan / "die-ball004.dng").touch()
    ending = shoots.run(source, out, CREWS[name], notes=notes)
    assert ending.counts == {"done": 7, "failed": 1}
    guilty = next(outcome for outcome in ending.outcomes if outcome.status == "failed")
    assert ending.items[guilty.number].photographs[0].path.name == "ball004.dng"
    assert "its worker died" in guilty.error
    assert any("ball004.dng" in note and "again, alone" in note for note in notes)
    assert name == "forks" or "SIGKILL" in guilty.error
    begun = Counter(line for line in lines(plan) if line.startswith("begin "))
    assert begun["begin ball004.dng"] == 2
    assert max(begun.values()) == 2
    (plan / "die-ball004.dng").unlink()
    assert shoots.run(source, out, resume=True).counts == {"kept": 7, "done": 1}


def test_workers_that_die_at_once_end_the_batch(tmp_path: Path) -> None:
    """A batch that can never begin does not try for ever."""

    @contextmanager
    def doomed(workers: int) -> Iterator[object]:
        from loky import ProcessPoolExecutor

        with ProcessPoolExecutor(max_workers=1, initializer=os._exit, initargs=(1,)) as pool:
            yield pool

    source = shoots.shoot(tmp_path / "shoot", 2)
    with pytest.raises(FitMaterialError, match="die before they begin"):
        shoots.run(source, tmp_path / "out", Crew(workers=1, engage=doomed))  # type: ignore[arg-type]  # an executor


def threads() -> tuple[str | None, int]:
    """What a worker has of threads."""
    import cv2
    import threadpoolctl

    cv2.setNumThreads(1)
    return os.environ.get("OMP_NUM_THREADS"), max(
        (p["num_threads"] for p in threadpoolctl.threadpool_info()), default=1
    )


def test_workers_have_one_thread_each() -> None:
    """Two workers on two cores: no more threads than cores."""
    with loky_processes(1) as pool:
        assert pool.submit(threads).result() == ("1", 1)


def test_memory_that_a_worker_keeps_is_no_leak() -> None:
    """Loky looks at it each second, would begin another worker and warn of the first on the terminal."""
    with warnings.catch_warnings(), loky_processes(1) as pool:
        warnings.simplefilter("error")
        first = pool.submit(os.getpid).result()
        assert pool.submit(held_for, 400 << 20, 1.1).result() is None
        assert pool.submit(held_for, 0, 1.1).result() is None
        assert pool.submit(os.getpid).result() == first


def test_workers_end_with_their_parent(tmp_path: Path) -> None:
    """A parent killed outright leaves no worker behind that could still write."""
    code = (
        "import time; from pipelines.batch.crew import loky_processes; import os\n"
        "with loky_processes(1) as pool:\n"
        "    print(pool.submit(os.getpid).result(), flush=True); pool.submit(time.sleep, 60).result()\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        parent.kill()
    for _ in range(200):
        if not alive(worker):
            break
        time.sleep(0.05)
    assert not alive(worker)


def held_for(size: int, seconds: float) -> None:
    """Keep so many bytes from now on, and go on for a while."""
    KEPT.append(bytearray(size))
    time.sleep(seconds)


KEPT: list[bytearray] = []


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] != "Z"
    except OSError:
        return False


def test_executors_that_do_not_exist_are_refused() -> None:
    """Another name, a port without a scheduler."""
    for name in ("ray", "dask://", "dask://host", "dask://host:x", "dask://a/b:1"):
        with pytest.raises(UsageError, match="expected loky or dask"):
            crew(name, jobs=None, version="1")


def test_a_cluster_loses_a_worker_and_no_photograph(tmp_path: Path, plan: Path) -> None:
    """Dask on loopback, one of two workers killed in mid-run: each photograph done once, the bytes those of loky's."""
    source = shoots.shoot(tmp_path / "shoot", 24, bad=(5,))
    (plan / "sleep").write_text("0.05")
    ended: list[int] = []
    with cluster(tmp_path) as (address, workers):
        engaged = crew(f"dask://{address}", jobs=None, version=toolkit.__version__)

        def strike(item: object, outcome: object) -> None:
            ended.append(1)
            if len(ended) == 6:
                workers[0].send_signal(signal.SIGKILL)

        ending = shoots.run(source, tmp_path / "dask", engaged, ended=strike, version=toolkit.__version__)
    assert workers[0].returncode == -signal.SIGKILL
    assert ending.counts == {"done": 23, "failed": 1}
    assert len(ended) == 24
    ends = Counter(line for line in lines(plan) if line.startswith("end "))
    assert sum(ends.values()) <= 24  # 23, and at most the one that was written but not told of
    (plan / "sleep").unlink()
    shoots.run(source, tmp_path / "loky", LOKY, version=toolkit.__version__)
    assert shoots.digests(tmp_path / "dask") == shoots.digests(tmp_path / "loky")


@pytest.mark.slow
def test_real_fits_on_a_cluster_are_those_of_loky(tmp_path: Path) -> None:
    """Forty small renders, one of dask's two workers killed in mid-run: every file of all results the same bytes."""
    (tmp_path / "shoot").mkdir()
    for number in range(REAL):
        paint = glossy("ggx", alpha=0.08 + 0.004 * number)
        path = tmp_path / "shoot" / f"ball{number:02d}.dng"
        size = {"width_px": 100, "height_px": 100}
        render_photograph(scene_of(100), paint, NOISE, **size, format="dng", exposure=None, seed=number, path=path)
    asked = {
        "work": fit_one,
        "settings_for": lambda one: resolve(one.path, presets=["quick"]),
        "page": True,
        "version": toolkit.__version__,
    }
    ended: list[int] = []
    with cluster(tmp_path) as (address, workers):

        def strike(item: object, outcome: object) -> None:
            ended.append(1)
            if len(ended) == REAL // 4:
                workers[0].send_signal(signal.SIGKILL)

        engaged = crew(f"dask://{address}", jobs=None, version=toolkit.__version__)
        ending = shoots.run(tmp_path / "shoot", tmp_path / "dask", engaged, ended=strike, **asked)
    assert workers[0].returncode == -signal.SIGKILL
    assert ending.counts == {"done": REAL}
    shoots.run(tmp_path / "shoot", tmp_path / "loky", LOKY, **asked)
    found, expected = shoots.digests(tmp_path / "dask"), shoots.digests(tmp_path / "loky")
    assert len(found) > 6 * REAL
    assert [name for name in expected if found.get(name) != expected[name]] == []
    assert found.keys() == expected.keys()


@pytest.mark.slow
def test_workers_of_several_threads_or_another_version_are_refused(tmp_path: Path) -> None:
    """Plots and decoders are not made for threads; versions are not mixed."""
    with cluster(tmp_path, threads_each=2) as (address, _):
        with pytest.raises(UsageError, match="several threads"):
            crew(f"dask://{address}", jobs=None, version=toolkit.__version__)
        with pytest.raises(UsageError, match="expected one version"):
            crew(f"dask://{address}", jobs=None, version="9.9.9")
