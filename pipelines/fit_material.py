"""The main job, read this first: from the file of a photograph to everything that is known of the material.

file -> RawFrame -> LinearImage -> Scene -> Fits (with their posteriors) -> ColourLayers, ModelLayers
-> MaterialReport
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from toolkit.records import CameraColour, ColourLayers, Fit, LinearImage, MaterialReport, ModelLayers, Photograph

from .clock import Clock, Progress, imported_meanwhile
from .settings import Settings

if TYPE_CHECKING:
    from toolkit.flags import Flag
    from toolkit.radiometry.quads import Quads

    from .drawing import Drawing, Lines
    from .workers import Workers


class Ahead(Protocol):
    """Who is told of what is there before the report is."""

    def join(self, crew: Workers) -> None:
        """Of the workers, while those may still be told of jobs."""

    def fits(self, image: LinearImage, fits: tuple[Fit, ...], best: int) -> None:
        """Of all fits to the photographs, of which `image` is the first."""

    def layers(self, number: int, image: LinearImage, layers: ModelLayers, lines: Lines) -> None:
        """Of a photograph's layers of the best fit, which may still be drawn: `lines(rows)` waits for some of them."""


def fit_material(
    path: Path, settings: Settings, *, progress: Progress | None = None, processes: int | None = None
) -> MaterialReport:
    """Fit every model asked for to one photograph.

    `progress(stage, fraction)` is told of each stage as it begins. `processes` fit models side by side, one a core
    where None. Raises BadInputError for a file or a scene that
    cannot be used, UsageError for settings that make no sense.
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
    from threadpoolctl import threadpool_limits

    from toolkit.inference.agreement import agreement
    from toolkit.inference.compare import rank
    from toolkit.inference.joint import of_photograph

    from .candidates import fit_models, fits_at_once
    from .drawing import Studio
    from .quality import quality_flags, shown_flags
    from .workers import workers

    # one thread for each product: they are small, so it is faster, and the sums are the same on every machine
    with threadpool_limits(1), workers(fits_at_once(settings, processes)) as crew:
        studio = Studio([(one.image, picture) for one, picture in looked], crew)
        if ahead is not None:
            ahead.join(crew)

        def show(v: int, fit: Fit) -> _Shown:
            """Begin a photograph's layers of this fit, and separate its colours meanwhile."""
            one, picture = looked[v]
            drawing = studio.drawing(v, fit)
            if ahead is not None:
                ahead.layers(v, one.image, drawing.layers, drawing.lines)
            separation, colour = _separated(one, picture, asked[v][1], fit)
            return _Shown(fit, drawing, separation, colour, shown_flags(one.image, one.scene))

        early: list[_Shown] = []  # of the first photograph by the likely best fit, while the last one is out

        with clock.stage("fit"):
            fits = fit_models(
                [(one.image, one.scene) for one, _ in looked],
                settings,
                progress,
                crew,
                idle=lambda so_far: early.append(show(0, so_far[rank(so_far)[0]])),
            )
            best, preferred, lead = rank(fits)
        if ahead is not None:
            ahead.fits(looked[0][0].image, fits, best)
        seen = []
        for v, ((one, _), (_, own)) in enumerate(zip(looked, asked, strict=True)):
            mine = of_photograph(fits[best], v)
            with clock.stage("separate"):
                shown = early[0] if early and early[0].fit is mine else show(v, mine)
            with clock.stage("layers"):
                layers = shown.drawing.whole()
                agreed = None if own.separation.method == "none" else agreement(shown.separation, layers, mine)
                full = replace(one, separation=shown.separation, layers=layers, agreement=agreed, colour=shown.colour)
            seen.append(replace(full, flags=one.flags + quality_flags(full, shown.flags, fits[best], preferred)))
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
    drawing: Drawing
    separation: ColourLayers | None
    colour: CameraColour | None
    flags: tuple[Flag, ...]  # of the photograph's samples alone


def _separated(
    one: Photograph, picture: Quads, settings: Settings, fit: Fit
) -> tuple[ColourLayers | None, CameraColour | None]:
    """The photograph's colours separated, where that is asked for and they can be, and the camera's own."""
    from .colours import seen_by_colour, separate_colours
    from .srgb import colour_of

    seen = None if settings.separation.method == "none" else seen_by_colour(one.image, picture, one.scene)
    separation = separate_colours(one.image, seen, one.scene, settings, fit, reference=one.reference, colour=one.colour)
    return separation, one.colour or colour_of(one.image.metadata, one.scene, separation)


def _look(path: Path, settings: Settings, clock: Clock) -> tuple[Photograph, Quads]:
    """Read one photograph, find the sphere and the light; also its picture."""
    from toolkit.io.read import read

    with imported_meanwhile("pipelines.candidates", "emcee"):
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
