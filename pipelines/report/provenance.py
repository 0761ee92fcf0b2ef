"""Where the numbers come from: the file, the camera, the geometry and light as given and as fitted, the software."""

from __future__ import annotations

from fractions import Fraction
from typing import cast

import numpy as np

from toolkit.records import Fit, Light, MaterialReport, Metadata, Scene

from .numbers import MISSING, digits, measured
from .result import software
from .rows import numbers
from .text import base_name, clean

Row = tuple[str, str]


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
        ("exposure", _exposure(metadata)),
        ("written by", clean(metadata.software)),
        ("white level", f"{image.white:g} image units" if np.isfinite(image.white) else "none"),
        ("noise", _noise(report)),
        ("read with", "; ".join(clean(note) for note in metadata.notes)),
    ]
    return [(term, value) for term, value in rows if value]


def _layout(report: MaterialReport) -> str:
    step = max((plane.step_px for plane in report.image.planes), default=1)
    return "mosaic, fitted sample by sample" if step > 1 else "three channels a pixel"


def _exposure(metadata: Metadata) -> str:
    told = []
    if metadata.exposure_s:
        fraction = Fraction(metadata.exposure_s).limit_denominator(8000)
        told.append(f"{fraction} s" if metadata.exposure_s < 0.5 else f"{metadata.exposure_s:g} s")
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
    return f"variance = gain × signal + read²; {terms}, {told[noise.source]}"


def scene_rows(report: MaterialReport) -> list[Row]:
    """Camera, sphere and lights as the fits started from, and where the best fit moved them."""
    scene, best = report.scene, report.fits[report.best]
    rows = [("projection", _projection(scene)), ("sphere", _sphere(scene)), ("sphere, best fit", _sphere(best.scene))]
    for index, (light, moved) in enumerate(zip(scene.lights, best.scene.lights, strict=False), start=1):
        name = "light" if len(scene.lights) == 1 else f"light {index}"
        rows += [(f"{name}, {scene.light_source}", _light(light)), (f"{name}, best fit", _light(moved))]
    rows.append(("scale", "absolute" if scene.scale == "absolute" else "relative: no irradiance was given"))
    return [*rows, *_nuisances(best)]


def _projection(scene: Scene) -> str:
    camera = scene.camera
    if camera.projection == "orthographic" or camera.focal_length_px is None or camera.principal_point_px is None:
        return "orthographic"
    x, y = camera.principal_point_px
    return f"perspective, focal length {digits(camera.focal_length_px, 6)} px, principal point ({x:g}, {y:g}) px"


def _sphere(scene: Scene) -> str:
    sphere = scene.sphere
    sds = np.sqrt(np.maximum(np.diag(sphere.covariance_px2), 0.0))
    x, y = (measured(value, float(sd)) for value, sd in zip(sphere.centre_px, sds[:2], strict=True))
    radius = measured(sphere.radius_px, float(sds[2]))
    return f"centre ({x}, {y}) px, radius {radius} px, ± {numbers(sds, 2)} px, {sphere.source}"


def _light(light: Light) -> str:
    from toolkit.geometry.lights import AnyLight

    one = cast(AnyLight, light)
    told = f"{one.kind}, towards {numbers(one.direction, 5)}"
    if one.kind == "point":
        told += f", at {numbers(one.position, 5)} sphere radii"
    if one.direction_sd_deg is not None:
        told += f" ± {digits(one.direction_sd_deg, 2)}°"
    if one.irradiance is not None:
        told += f", irradiance {numbers(one.irradiance)}"
    return told


def _nuisances(fit: Fit) -> list[Row]:
    shifts = [f"{clean(name)} {measured(shift, sd)} ± {digits(sd, 2)}" for name, (shift, sd) in fit.nuisances.items()]
    return [("calibration moved by", "; ".join(shifts))] if shifts else []


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
