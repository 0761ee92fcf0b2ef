"""The sphere of known material that a scene file describes: what is rendered, and what a photograph is planned of."""

from __future__ import annotations

from synthetic.materials import Material, material
from toolkit.errors import BadInputError
from toolkit.records import Scene

from .settings import Settings, camera_of, lights_of, model_and_variant, sphere_of


def made_of(settings: Settings) -> tuple[Scene, Material, tuple[int, int]]:
    """Scene, material, and the frame's width and height; raises BadInputError where one is missing."""
    image, table, sphere = settings.image, settings.material, sphere_of(settings)
    if sphere is None or table is None or image.width_px is None or image.height_px is None or not settings.light:
        raise BadInputError(f"the scene lacks {_lacking(settings)}; expected what a render needs")
    model, variant = model_and_variant(table.model)
    known = any(light.irradiance is not None for light in settings.light)
    scene = Scene(
        camera=camera_of(settings, width_px=image.width_px, height_px=image.height_px),
        sphere=sphere,
        lights=lights_of(settings),
        scale="absolute" if known else "relative",
    )
    made = material(model, table.parameters, diffuse=table.diffuse, variant=variant)
    return scene, made, (image.width_px, image.height_px)


def _lacking(settings: Settings) -> str:
    there = {
        "[sphere]": settings.sphere,
        "[[light]]": settings.light,
        "[material]": settings.material,
        "image.width_px": settings.image.width_px,
        "image.height_px": settings.image.height_px,
    }
    return ", ".join(name for name, value in there.items() if not value)
