"""Which models are fitted: those asked for, and the best of them with the other diffuse lobes."""

from __future__ import annotations

from toolkit.errors import BadInputError
from toolkit.inference.cells import Cells
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.records import Fit, LinearImage, Scene
from toolkit.reflectance import LOBES

from .clock import Progress
from .settings import Settings, model_and_variant

FEWEST_CELLS = 60  # per channel: fewer lit, unclipped cells cannot hold a fit
OTHER_DIFFUSE = ("oren-nayar", "wolff")  # tried with the best specular lobe where nothing was asked for


def fit_models(image: LinearImage, scene: Scene, settings: Settings, progress: Progress | None) -> tuple[Fit, ...]:
    """One fit for every specular and diffuse lobe asked for; raises BadInputError where too little is lit."""
    cells = usable_cells(image, scene)
    bodies = settings.fit.diffuse or ("lambert",)
    fits: list[Fit] = []

    def fit(model: str, diffuse: str, done: float) -> Fit:
        name, variant = model_and_variant(model)
        label = f"fit {name} over {diffuse}"
        if progress is not None:
            progress(label, done)
        return infer(
            image,
            scene,
            cells,
            Model.named(name, diffuse, variant, neutral=settings.fit.specular == "neutral"),
            seed=settings.fit.seed,
            fixed=settings.fit.fix,
            discrepancy=settings.fit.discrepancy == "on",
            effective=settings.fit.ess,
        )

    wanted = [(model, body) for body in bodies for model in settings.fit.models]
    further = [] if settings.fit.diffuse else [body for body in OTHER_DIFFUSE if body in LOBES]
    for model, body in wanted:
        fits.append(fit(model, body, len(fits) / (len(wanted) + len(further))))
    best = max(range(len(fits)), key=lambda i: fits[i].elpd)
    for body in further:
        fits.append(fit(wanted[best][0], body, len(fits) / (len(wanted) + len(further))))
    return tuple(fits)


def usable_cells(image: LinearImage, scene: Scene) -> Cells:
    """The cells of a photograph; raises BadInputError where too few samples are lit and unclipped."""
    cells = gather_for(image, scene)
    fewest = min(len(data.rows) for data in cells.channels)
    if fewest >= FEWEST_CELLS:
        return cells
    if all_flagged(image):
        raise BadInputError(
            f"{image.name}: almost every sample of the sphere is clipped; expected an exposure that keeps "
            "most of the sphere below white: shorten the exposure"
        )
    raise BadInputError(
        f"{image.name}: only {fewest} lit places of the sphere can be used, expected {FEWEST_CELLS} or more: "
        "check the light's direction and the sphere, or photograph the sphere larger"
    )


def all_flagged(image: LinearImage) -> bool:
    """Whether more than nine samples in ten are flagged."""
    total = sum(plane.flags.size for plane in image.planes)
    return sum(int((plane.flags != 0).sum()) for plane in image.planes) > 0.6 * total
