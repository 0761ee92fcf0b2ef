"""The main job, read this first: from the file of a photograph to everything that is known of the material.

file -> RawFrame -> LinearImage -> Scene -> ColourLayers -> Fits (with their posteriors)
-> ModelLayers -> MaterialReport
"""

from __future__ import annotations

from pathlib import Path

from toolkit.records import MaterialReport

from .clock import Clock, Progress, imported_meanwhile
from .settings import Settings


def fit_material(
    path: Path, settings: Settings, *, progress: Progress | None = None, processes: int | None = None
) -> MaterialReport:
    """Fit every model asked for to one photograph.

    `progress(stage, fraction)` is told of each stage as it begins. `processes` fit models side by side, one a core
    where None. Raises BadInputError for a file or a scene that
    cannot be used, UsageError for settings that make no sense.
    """
    from toolkit.io.read import read

    clock = Clock(progress)
    with imported_meanwhile("pipelines.candidates", "emcee"):
        with clock.stage("read"):
            frame = read(path)
        from toolkit.radiometry.quads import quads

        from .colours import layers_of_fit, separate_colours
        from .locate import locate
        from .quality import quality_flags

        with clock.stage("locate"):
            image, scene, found = locate(frame, settings)
            picture = quads(image)
        with clock.stage("separate"):
            separation = separate_colours(image, picture, scene, settings)
    from toolkit.inference.compare import rank

    from .candidates import fit_models

    with clock.stage("fit"):
        fits = fit_models(image, scene, settings, progress, processes=processes)
        best, preferred, lead = rank(fits)
    with clock.stage("layers"):
        layers = layers_of_fit(image, picture, fits[best])
    return MaterialReport(
        image=image,
        scene=scene,
        separation=separation,
        fits=fits,
        best=best,
        preferred=preferred,
        elpd_difference=lead,
        layers=layers,
        flags=found
        + quality_flags(image, scene, separation, fits[best], preferred, asked=settings.separation.method != "none"),
        seconds=clock.seconds,
    )
