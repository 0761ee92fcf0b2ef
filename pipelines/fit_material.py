"""The main job, read this first: from the file of a photograph to everything that is known of the material.

file -> RawFrame -> LinearImage -> Scene -> Fits (with their posteriors) -> ColourLayers, ModelLayers
-> MaterialReport
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from toolkit.records import Fit, LinearImage, MaterialReport, ModelLayers, Photograph

from .clock import Clock, Progress, imported_meanwhile
from .settings import Settings

if TYPE_CHECKING:
    from toolkit.flags import Flag
    from toolkit.radiometry.quads import Quads

    from .drawing import Drawing, Take
    from .workers import Workers


class Ahead(Protocol):
    """Who is told of what is there before the report is."""

    def join(self, crew: Workers) -> None:
        """Of the workers, while those may still be told of jobs."""

    def fits(self, image: LinearImage, fits: tuple[Fit, ...], best: int) -> None:
        """Of all fits to the photographs, of which `image` is the first."""

    def layers(self, number: int, image: LinearImage, layers: ModelLayers) -> Take:
        """Of a photograph's layers of the best fit, before they are drawn: what takes their rows as they are."""


def fit_material(
    path: Path, settings: Settings, *, progress: Progress | None = None, processes: int | None = None
) -> MaterialReport:
    """Fit every model asked for to one photograph.

    `progress(stage, fraction)` is told of each stage as it begins. `processes` fit models side by side, one a core
    where None. Raises BadInputError for a file or a scene that cannot be used, UsageError for settings that make no
    sense.
    """
    return fit_jointly([(path, settings)], progress=progress, processes=processes)


def fit_jointly(
    asked: Sequence[tuple[Path, Settings]],
    *,
    progress: Progress | None = None,
    processes: int | None = None,
    ahead: Ahead | None = None,
) -> MaterialReport:
    """Fit every model to several photographs of one material at once, each under its own settings.

    They share the shape and the colours; light, sphere, black level and unknown irradiance are each one's own. What
    is fitted the first one's settings say. `ahead` is told of fits and layers as soon as they are known: they are what
    takes longest to write.
    """
    clock, settings = Clock(progress), asked[0][1]
    looked = [_look(path, own, clock) for path, own in asked]
    from toolkit.inference.compare import rank
    from toolkit.inference.joint import of_photograph

    from .candidates import fit_models, fits_at_once
    from .drawing import Studio
    from .quality import quality_flags
    from .threads import one_thread_each
    from .workers import workers

    with one_thread_each(), workers(fits_at_once(settings, processes)) as crew, ThreadPoolExecutor(1) as beside:
        studio = Studio([(one.image, picture) for one, picture in looked], crew)
        early: list[Future[_Shown]] = []  # of the first photograph by the likely best fit, while the last one is out
        if ahead is not None:
            ahead.join(crew)

        def show(v: int, fit: Fit) -> _Shown:
            one, picture = looked[v]
            drawing = studio.draw(v, fit, partial(ahead.layers, v, one.image) if ahead else None)
            return _shown(one, picture, asked[v][1], fit, drawing)

        def idle(so_far: tuple[Fit, ...]) -> None:
            early.append(beside.submit(show, 0, so_far[rank(so_far)[0]]))

        with clock.stage("fit"):
            fits = fit_models([(one.image, one.scene) for one, _ in looked], settings, progress, crew, idle=idle)
            best, preferred, lead = rank(fits)
        if ahead is not None:
            ahead.fits(looked[0][0].image, fits, best)
        seen = []
        with clock.stage("layers"):
            for v in range(len(looked)):
                mine = of_photograph(fits[best], v)
                shown = early.pop().result() if early else show(v, mine)
                if shown.fit is not mine:
                    shown = show(v, mine)
                more = quality_flags(shown.photograph, shown.flags, fits[best], preferred)
                seen.append(replace(shown.photograph, flags=shown.photograph.flags + more))
    return MaterialReport(
        image=seen[0].image,
        scene=seen[0].scene,
        separation=seen[0].separation,
        agreement=seen[0].agreement,
        fits=fits,
        best=best,
        preferred=preferred,
        elpd_difference=lead,
        layers=seen[0].layers,
        flags=tuple(dict.fromkeys(flag for one in seen for flag in one.flags)),
        seconds=clock.seconds,
        reference=seen[0].reference,
        colour=seen[0].colour,
        photographs=tuple(seen) if len(seen) > 1 else (),
    )


class _Shown(NamedTuple):
    """What is shown of a photograph by a fit."""

    fit: Fit
    photograph: Photograph
    flags: tuple[Flag, ...]  # of its samples alone


def _shown(one: Photograph, picture: Quads, settings: Settings, fit: Fit, drawing: Drawing) -> _Shown:
    """The photograph's colours separated, where that is asked for and they can be, while its layers are drawn."""
    from toolkit.inference.agreement import agreement

    from .colours import seen_by_colour, separate_colours
    from .quality import shown_flags
    from .srgb import colour_of

    in_colour = settings.separation.method != "none"
    values = seen_by_colour(one.image, picture, one.scene) if in_colour else None
    separation = separate_colours(
        one.image, values, one.scene, settings, fit, reference=one.reference, colour=one.colour
    )
    colour = one.colour or colour_of(one.image.metadata, one.scene, separation)
    flags = shown_flags(one.image, one.scene)
    layers = drawing.whole()
    agreed = agreement(separation, layers, fit) if in_colour else None
    full = replace(one, separation=separation, layers=layers, agreement=agreed, colour=colour)
    return _Shown(fit, full, flags)


def _look(path: Path, settings: Settings, clock: Clock) -> tuple[Photograph, Quads]:
    """Read one photograph, find the sphere and the light; also its picture."""
    from toolkit.io.read import read

    with imported_meanwhile("pipelines.candidates", "emcee", "cv2"):
        with clock.stage("read"):
            frame = read(path)
        from toolkit.radiometry.quads import quads

        from .locate import locate
        from .srgb import chart_of

        with clock.stage("locate"):
            image, scene, reference, found = locate(frame, settings, path.parent)
            chart = chart_of(frame, path, settings)
            picture = quads(image)
    return Photograph(image=image, scene=scene, flags=found, reference=reference, colour=chart), picture
