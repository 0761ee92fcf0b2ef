"""The main job, read this first: from the file of a photograph to everything that is known of the material.

file -> RawFrame -> LinearImage -> Scene -> ColourLayers -> Fits (with their posteriors)
-> ModelLayers -> MaterialReport
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.records import MaterialReport, Photograph

from .clock import Clock, Progress, imported_meanwhile
from .settings import Settings

if TYPE_CHECKING:
    from toolkit.radiometry.quads import Quads


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
    asked: Sequence[tuple[Path, Settings]], *, progress: Progress | None = None, processes: int | None = None
) -> MaterialReport:
    """Fit every model to several photographs of one material at once, each under its own settings.

    They share the shape and the colours; light, sphere, black level and unknown irradiance are each one's own. What
    is fitted the first one's settings say.
    """
    clock, settings = Clock(progress), asked[0][1]
    looked = [_look(path, own, clock) for path, own in asked]
    from toolkit.inference.compare import rank
    from toolkit.inference.joint import of_photograph

    from .candidates import fit_models
    from .colours import layers_of_fit
    from .quality import quality_flags

    with clock.stage("fit"):
        fits = fit_models([(one.image, one.scene) for one, _ in looked], settings, progress, processes=processes)
        best, preferred, lead = rank(fits)
    seen = []
    with clock.stage("layers"):
        for v, (one, picture) in enumerate(looked):
            flags = quality_flags(one, fits[best], preferred, asked=settings.separation.method != "none")
            layers = layers_of_fit(one.image, picture, of_photograph(fits[best], v))
            seen.append(replace(one, layers=layers, flags=one.flags + flags))
    return MaterialReport(
        image=seen[0].image,
        scene=seen[0].scene,
        separation=seen[0].separation,
        fits=fits,
        best=best,
        preferred=preferred,
        elpd_difference=lead,
        layers=seen[0].layers,
        flags=tuple(dict.fromkeys(flag for one in seen for flag in one.flags)),
        seconds=clock.seconds,
        photographs=tuple(seen) if len(seen) > 1 else (),
    )


def _look(path: Path, settings: Settings, clock: Clock) -> tuple[Photograph, Quads]:
    """Read one photograph, find the sphere and the light, separate by colour; also its picture."""
    from toolkit.io.read import read

    with imported_meanwhile("pipelines.candidates", "emcee"):
        with clock.stage("read"):
            frame = read(path)
        from toolkit.radiometry.quads import quads

        from .colours import separate_colours
        from .locate import locate

        with clock.stage("locate"):
            image, scene, found = locate(frame, settings)
            picture = quads(image)
        with clock.stage("separate"):
            separation = separate_colours(image, picture, scene, settings)
    return Photograph(image=image, scene=scene, separation=separation, layers=None, flags=found), picture
