"""Where the numbers come from: the file, the camera, the geometry and light as given and as fitted, the software."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from pipelines.srgb import light_of
from toolkit.inference.moved_light import Vector
from toolkit.records import Fit, Light, MaterialReport, Metadata, Reference, Scene, Sphere

from .fitted import fitted_light
from .numbers import MISSING, digits, measured, percent
from .result import software
from .rows import numbers
from .text import base_name, clean

Row = tuple[str, str]
SPHERE = ("sphere.centre_x_px", "sphere.centre_y_px", "sphere.radius_px")  # as the fit names its shifts


def file_rows(report: MaterialReport) -> list[Row]:
    """The photograph and how it was taken."""
    image, metadata = report.image, report.image.metadata
    rows = [
        ("file", base_name(image.name)),
        ("SHA-256", clean(image.sha256)),
        ("size", f"{image.width_px} × {image.height_px} px, {_layout(report)}"),
        ("camera", clean(f"{metadata.make} {metadata.model}")),
        ("lens", clean(metadata.lens)),
        ("taken", clean(metadata.taken)),
        ("exposure", exposure(metadata)),
        ("written by", clean(metadata.software)),
        ("white level", f"{image.white:g} image units" if np.isfinite(image.white) else "none"),
        ("noise", _noise(report)),
        ("read with", "; ".join(clean(note) for note in metadata.notes)),
    ]
    return [(term, value) for term, value in rows if value]


def _layout(report: MaterialReport) -> str:
    step = max((plane.step_px for plane in report.image.planes), default=1)
    return "mosaic, fitted sample by sample" if step > 1 else "three channels a pixel"


def shutter(seconds: float) -> str:
    """An exposure time as cameras write it: 1/125 s, 0.5 s."""
    if seconds >= 0.5:
        return f"{seconds:.3g} s"
    return f"1/{round(1 / seconds)} s"


def exposure(metadata: Metadata) -> str:
    """Time, aperture, sensitivity and focal length, as far as the file tells them."""
    told = []
    if metadata.exposure_s:
        told.append(shutter(metadata.exposure_s))
    if metadata.f_number:
        told.append(f"f/{metadata.f_number:g}")
    if metadata.iso:
        told.append(f"ISO {metadata.iso:g}")
    if metadata.focal_length_mm:
        told.append(f"{metadata.focal_length_mm:g} mm")
    return ", ".join(told)


def _noise(report: MaterialReport) -> str:
    noise = report.image.noise
    told = {
        "given": "as given",
        "noise_profile": "from the file's noise profile",
        "estimated": "estimated from the image",
    }
    terms = f"gain {numbers(noise.gain, 3)}, read {numbers(noise.read, 3)}"
    if noise.gain_sd is not None and noise.read_sd is not None:
        told["estimated"] += f" to ± {numbers(noise.gain_sd, 2)} and ± {numbers(noise.read_sd, 2)}"
    return f"variance = gain × signal + read²; {terms}, {told[noise.source]}"


def scene_rows(report: MaterialReport) -> list[Row]:
    """Camera, sphere and lights as the fits started from, and where the best fit moved them."""
    scene, best = report.scene, report.fits[report.best]
    moved = _place(best.scene.sphere, [best.nuisances.get(name, (0.0, None))[1] for name in SPHERE])
    rows = [("projection", _projection(scene)), (f"sphere, {scene.sphere.source}", _sphere(scene.sphere))]
    rows.append(("sphere, best fit", moved))
    for index, light in enumerate(scene.lights):
        name = "light" if len(scene.lights) == 1 else f"light {index}"
        rows += [(f"{name}, {scene.light_source}", _light(light)), (f"{name}, best fit", _moved(best, index))]
    rows.append(("scale", "absolute" if report.scale == "absolute" else "relative: no irradiance was given"))
    rows += [("grey card", _card(report.reference))] if report.reference else []
    rows += [("colours", _colours(report))]
    return [*rows, *_other_photographs(report), *_nuisances(best)]


def _other_photographs(report: MaterialReport) -> Iterator[Row]:
    """Of a joint fit, what the photographs after the first were and where the best fit moved their scenes."""
    from toolkit.inference.joint import of_photograph

    for v, one in enumerate(report.photographs[1:], start=1):
        part, name = of_photograph(report.fits[report.best], v), f"photograph {v + 1}"
        yield name, f"{base_name(one.image.name)}, {_projection(one.scene)}"
        yield f"{name}, sphere {one.scene.sphere.source}", _sphere(one.scene.sphere)
        for index, light in enumerate(one.scene.lights):
            yield f"{name}, light {one.scene.light_source}", _light(light)
            yield f"{name}, light, best fit", _moved(part, index)


def _card(card: Reference) -> str:
    x, y, width, height = card.box_px
    where = f"{width} × {height} px at ({x}, {y})" + (f" of {base_name(card.file)}" if card.file else "")
    return (
        f"reflectance {numbers(card.grey)}, {where}, normal {numbers(card.normal)}: irradiance "
        f"{numbers(card.irradiance)} ± {numbers(card.irradiance_sd, 2)}"
    )


def _colours(report: MaterialReport) -> str:
    colour = report.colour
    if colour is None:
        return "the camera's own RGB: the file carries no colour matrix"
    how = {
        "forward-matrix": "by the file's forward matrix",
        "colour-matrix": "by the file's colour matrix",
        "chart": "by a colour chart",
    }[colour.source]
    missed = (
        "" if colour.delta_e is None else f", CIEDE2000 {digits(colour.delta_e, 2)} on its patches left out in turn"
    )
    return f"linear sRGB {how}{missed}; light {numbers(light_of(report))} in camera RGB"


def _projection(scene: Scene) -> str:
    camera = scene.camera
    if camera.projection == "orthographic" or camera.focal_length_px is None or camera.principal_point_px is None:
        return "orthographic"
    x, y = camera.principal_point_px
    return f"perspective, focal length {digits(camera.focal_length_px, 6)} px, principal point ({x:g}, {y:g}) px"


def _sphere(sphere: Sphere) -> str:
    return _place(sphere, [float(np.sqrt(max(variance, 0.0))) for variance in np.diag(sphere.covariance_px2)])


def _place(sphere: Sphere, sds: Sequence[float | None]) -> str:
    values = (*sphere.centre_px, sphere.radius_px)
    x, y, radius = (
        f"{measured(value, sd)}" + (f" ± {digits(sd, 2)}" if sd else "") for value, sd in zip(values, sds, strict=True)
    )
    return f"centre x {x}, y {y}, radius {radius} px"


def _light(light: Light) -> str:
    from toolkit.geometry.lights import AnyLight

    one = cast(AnyLight, light)
    told = f"{one.kind}, {_towards(one.direction, one.position if one.kind == 'point' else None, one.direction_sd_deg)}"
    if one.irradiance is not None:
        told += f", irradiance {numbers(one.irradiance)}{_within(light, 'irradiance_relative_sd')}"
    back = _within(light, "returned_sd")
    return f"{told},{back} of it may come back from around" if back else told


def _within(light: Light, name: str) -> str:
    """A relative sd, where one was stated."""
    sd = getattr(light, name, None)
    return f" ± {percent(sd)}" if sd else ""


def _moved(fit: Fit, index: int) -> str:
    light = fitted_light(fit, index)
    return _towards(light.direction, light.position, light.sd_deg)


def _towards(direction: Vector, position: Vector | None, sd_deg: float | None) -> str:
    told = f"towards {numbers(direction, 5)}"
    if position is not None:
        told += f", at {numbers(position, 5)} sphere radii"
    return told if sd_deg is None else f"{told} ± {digits(sd_deg, 2)}°"


def _nuisances(fit: Fit) -> list[Row]:
    """What the calibration turned out to be off by: angles in degrees, scales as factors, the rest in its own unit."""
    return [(f"calibration: {_named(name)}", _shift(name, *pair)) for name, pair in fit.nuisances.items()]


def _named(name: str) -> str:
    return (
        clean(name)
        .removesuffix("_rad")
        .removesuffix("_px")
        .replace("_per_radius", "")
        .replace("_", " ")
        .replace(".", " ")
    )


def _shift(name: str, shift: float, sd: float) -> str:
    if name.endswith("_rad"):
        return f"{measured(math.degrees(shift), math.degrees(sd))}° ± {digits(math.degrees(sd), 2)}°"
    if "scale_" in name:  # a logarithm
        factor = math.exp(shift)
        return f"{measured(factor, factor * sd)} ± {digits(factor * sd, 2)} times"
    endings = {"_px": " px", "_per_radius": " per sphere radius"}
    unit = next((unit for ending, unit in endings.items() if name.endswith(ending)), "")
    unit = " of the light" if "returned_" in name else unit
    return f"{measured(shift, sd)} ± {digits(sd, 2)}{unit}"


def sampling_rows(report: MaterialReport) -> list[Row]:
    """How the best fit's posterior was sampled."""
    found = report.fits[report.best].diagnostics
    if found is None:
        return []
    return [
        ("draws", f"{found.samples}"),
        ("effective, least", digits(found.ess_min)),
        ("R-hat, most", f"{found.r_hat_max:.4f}" if np.isfinite(found.r_hat_max) else MISSING),
        ("autocorrelation, longest", f"{digits(found.tau_max, 3)} steps"),
        ("acceptance", digits(found.acceptance, 2)),
        ("seed", f"{found.seed}"),
    ]


def software_rows() -> list[Row]:
    """Versions of everything that computes."""
    return [(name, version or MISSING) for name, version in software().items()]
