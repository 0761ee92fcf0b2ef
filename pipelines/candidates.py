"""Which models are fitted: those asked for, and the best of them with the other diffuse lobes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain

from toolkit.errors import BadInputError
from toolkit.inference.cells import Cells
from toolkit.inference.infer import gather_for, infer_views
from toolkit.inference.model import Model
from toolkit.inference.views import View
from toolkit.records import Fit, LinearImage, Scene

from .clock import Progress
from .settings import Settings, model_and_variant
from .workers import Workers, side_by_side

FEWEST_CELLS = 60  # per channel: fewer lit, unclipped cells cannot hold a fit
OTHER_BODIES = ("oren-nayar", "wolff")  # tried with the best model unasked; costlier ones wait for `--diffuse`
Pair = tuple[str, str]  # a specular model with its variant, a diffuse lobe
Idle = Callable[[tuple[Fit, ...]], None]


def fit_models(
    photographs: Sequence[tuple[LinearImage, Scene]],
    settings: Settings,
    progress: Progress | None,
    crew: Workers,
    *,
    idle: Idle | None = None,
) -> tuple[Fit, ...]:
    """One fit to all photographs for every specular and diffuse lobe asked for.

    Raises BadInputError where too little of one is lit. Without a diffuse lobe asked for, every model is fitted over
    Lambert, then the best of them over OTHER_BODIES. The `crew` fits side by side, libraries should have one thread
    each; then `idle` is told of all fits but the last as soon as they are there.
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

    crew.learn(fit)
    wanted, others = _asked(settings)
    fits: dict[Pair, Fit] = {}
    total = len(wanted) + len(others)

    def ended(pair: Pair, found: Fit) -> None:
        fits[pair] = found
        if progress is not None:
            progress(f"fitted {pair[0]} over {pair[1]}", len(fits) / total)
        if idle is not None and crew.count > 1 and len(fits) == total - 1:
            idle(tuple(fits.values()))

    guess, ahead = "", iter(list[tuple[Pair, Fit]]())
    for pair, found in crew.each(fit, wanted):
        ended(pair, found)
        if len(fits) == len(wanted) - 1:  # a core falls idle: the best of all but one is likely that of all
            guess = _best(wanted, fits)
            ahead = crew.each(fit, _over(guess, others[-1:]), guess=True)
    best = _best(wanted, fits)
    right = guess == best
    rest = crew.each(fit, _over(best, others[:-1] if right else others))
    for pair, found in chain(ahead if right else (), rest):
        ended(pair, found)
    return tuple(fits[pair] for pair in (*wanted, *_over(best, others)[::-1]))


def fits_at_once(settings: Settings, processes: int | None) -> int:
    """How many fits are made side by side: by so many `processes`, one a core where None; as many as there ever are."""
    wanted, others = _asked(settings)
    return min(side_by_side(processes), max(len(wanted), len(others)))


def _asked(settings: Settings) -> tuple[list[Pair], Sequence[str]]:
    """The pairs to be fitted in any case, and the other bodies to be tried with the best of them."""
    wanted = [(model, body) for body in settings.fit.diffuse or ("lambert",) for model in settings.fit.models]
    return list(dict.fromkeys(wanted)), () if settings.fit.diffuse else OTHER_BODIES  # one asked for twice is one


def _best(pairs: Sequence[Pair], fits: Mapping[Pair, Fit]) -> str:
    """The model of those fitted that predicts best."""
    return max((pair for pair in pairs if pair in fits), key=lambda pair: fits[pair].elpd)[0]


def _over(model: str, bodies: Sequence[str]) -> list[Pair]:
    """The costlier pairs first, so that no core waits for the other at the end."""
    return [(model, body) for body in bodies[::-1]]


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
