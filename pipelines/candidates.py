"""Which models are fitted: those asked for, and the best of them with the other diffuse lobes."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from itertools import chain
from multiprocessing.process import BaseProcess

from toolkit.errors import BadInputError
from toolkit.inference.cells import Cells
from toolkit.inference.infer import gather_for, infer_views
from toolkit.inference.model import Model
from toolkit.inference.views import View
from toolkit.records import Fit, LinearImage, Scene

from .clock import Progress
from .interrupts import interrupts_held
from .memory import keep_memory
from .settings import Settings, model_and_variant

FEWEST_CELLS = 60  # per channel: fewer lit, unclipped cells cannot hold a fit
OTHER_BODIES = ("oren-nayar", "wolff")  # tried with the best model unasked; costlier ones wait for `--diffuse`
Pair = tuple[str, str]  # a specular model with its variant, a diffuse lobe
Job = Callable[[Pair], Fit]
Ended = tuple[Pair, Fit]
Idle = Callable[[Sequence[Fit]], None]


def fit_models(
    photographs: Sequence[tuple[LinearImage, Scene]],
    settings: Settings,
    progress: Progress | None,
    *,
    processes: int | None = None,
    idle: Idle | None = None,
) -> tuple[Fit, ...]:
    """One fit to all photographs for every specular and diffuse lobe asked for.

    Raises BadInputError where too little of one is lit. Without a diffuse lobe asked for, every model is fitted over
    Lambert, then the best of them over OTHER_BODIES. `processes` work side by side, one a core where None: libraries
    should have one thread each. Where they do, `idle` is told of all fits but the last as soon as they are there.
    """
    views = [View.of(scene, usable_cells(image, scene), image.noise) for image, scene in photographs]

    def fit(pair: Pair) -> Fit:
        name, variant = model_and_variant(pair[0])
        return infer_views(
            views,
            Model.named(name, pair[1], variant, neutral=settings.fit.specular == "neutral"),
            seed=settings.fit.seed,
            fixed=settings.fit.fix,
            discrepancy=settings.fit.discrepancy == "on",
            effective=settings.fit.ess,
        )

    wanted = [(model, body) for body in settings.fit.diffuse or ("lambert",) for model in settings.fit.models]
    wanted = list(dict.fromkeys(wanted))  # a model asked for twice is one
    others = () if settings.fit.diffuse else OTHER_BODIES
    fits: dict[Pair, Fit] = {}
    workers, total = _count(processes, most=max(len(wanted), len(others))), len(wanted) + len(others)

    def ended(pair: Pair, found: Fit) -> None:
        fits[pair] = found
        if progress is not None:
            progress(f"fitted {pair[0]} over {pair[1]}", len(fits) / total)
        if idle is not None and workers > 1 and len(fits) == total - 1:
            idle(tuple(fits.values()))

    with _workers(fit, workers) as each_of:
        guess, ahead = "", iter(list[Ended]())
        for pair, found in each_of(wanted):
            ended(pair, found)
            if len(fits) == len(wanted) - 1:  # a core falls idle: the best of all but one is likely that of all
                guess = _best(wanted, fits)
                ahead = each_of(_over(guess, others[-1:]))
        best = _best(wanted, fits)
        right = guess == best
        rest = each_of(_over(best, others[:-1] if right else others))
        for pair, found in chain(ahead if right else (), rest):
            ended(pair, found)
        return tuple(fits[pair] for pair in (*wanted, *_over(best, others)[::-1]))


def _best(pairs: Sequence[Pair], fits: Mapping[Pair, Fit]) -> str:
    """The model of those fitted that predicts best."""
    return max((pair for pair in pairs if pair in fits), key=lambda pair: fits[pair].elpd)[0]


def _over(model: str, bodies: Sequence[str]) -> list[Pair]:
    """The costlier pairs first, so that no core waits for the other at the end."""
    return [(model, body) for body in bodies[::-1]]


_job: Job | None = None  # what the children of a fork find where the parent left it


def _run(pair: Pair) -> Ended:
    if _job is None:
        raise RuntimeError("a worker was started without its job")
    return pair, _job(pair)


def _count(processes: int | None, *, most: int) -> int:
    """How many fits are made side by side: one where this process may have no children."""
    if multiprocessing.current_process().daemon or os.environ.get(ALONE):
        return 1
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    return min(processes or cores, most)


@contextmanager
def _workers(fit: Job, workers: int) -> Iterator[Callable[[Sequence[Pair]], Iterator[Ended]]]:
    """What gives fits as they end: in forks of this process, begun at once, side by side; of a single worker one by
    one, each when it is asked for.

    On an interrupt the forks end at once instead of with their work.
    """
    global _job  # a fork inherits it, with the photograph, at no cost
    if workers < 2:
        yield lambda pairs: ((pair, fit(pair)) for pair in pairs)
        return
    _job, others = fit, set(multiprocessing.active_children())
    fork = multiprocessing.get_context("fork")
    pool = ProcessPoolExecutor(workers, mp_context=fork, initializer=_settle_in)
    begun: list[Future[Ended]] = []
    try:
        yield partial(_begun, pool, begun)
    except BaseException:
        _end_all_but(others)
        pool.shutdown()
        raise
    finally:
        _job = None
    if not all(future.done() for future in begun):  # over what was no good guess
        _end_all_but(others)
    pool.shutdown(wait=False)  # nobody waits for the forks to tidy up


def _end_all_but(others: Collection[BaseProcess]) -> None:
    for child in set(multiprocessing.active_children()) - set(others):
        child.terminate()


def _begun(pool: ProcessPoolExecutor, begun: list[Future[Ended]], pairs: Sequence[Pair]) -> Iterator[Ended]:
    with interrupts_held():  # one that struck between a fork and its entry in the books would leave it running
        futures = [pool.submit(_run, pair) for pair in pairs]
    begun += futures
    return (future.result() for future in as_completed(futures))


def _settle_in() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # interrupts are the parent's to answer
    keep_memory()


ALONE = "FIT_MATERIAL_ONE_PROCESS"  # set where the cores are busy with other photographs


def usable_cells(image: LinearImage, scene: Scene) -> Cells:
    """The cells of a photograph; raises BadInputError where too few samples are lit and unclipped."""
    cells = gather_for(image, scene)
    fewest = min(int((~data.censored).sum()) for data in cells.channels)
    if fewest >= FEWEST_CELLS:
        return cells
    if mostly_flagged(image):
        raise BadInputError(
            f"{image.name}: almost every sample of the sphere is clipped; expected an exposure that keeps "
            "most of the sphere below white: shorten the exposure"
        )
    raise BadInputError(
        f"{image.name}: only {fewest} lit places of the sphere can be used, expected {FEWEST_CELLS} or more: "
        "check the light's direction and the sphere, or photograph the sphere larger"
    )


def mostly_flagged(image: LinearImage) -> bool:
    """Whether more than six in ten samples of the sphere's box are flagged."""
    total = sum(plane.flags.size for plane in image.planes)
    return sum(int((plane.flags != 0).sum()) for plane in image.planes) > 0.6 * total
