"""Spheres rendered by Mitsuba from measured materials (RGL): no lobe is their truth, and what is left is model error.

python -m tests.validation.measured     prints the table of docs/validation.md; a few minutes

Calibration is told exactly and held, so that nothing but the lobes can be wrong.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.fit_material import fit_material
from pipelines.layers import Layer, resolve
from pipelines.validate.stress import ALARMS
from synthetic import camera
from synthetic.materials import Material, material
from synthetic.photograph import write_raw
from synthetic.render import Render
from synthetic.render import render as our_render
from synthetic.scenes import exposed, write_scene_toml
from tests.realdata import folder
from tests.validation.mitsuba_render import Ball, render
from toolkit.records import Fit, Floats, MaterialReport

MATERIALS = ("cc_iris_purple_gem", "paper_white", "satin_rosaline", "vch_golden_yellow")
LIGHTS = ((25.0, 130.0), (45.0, 40.0), (60.0, 250.0))  # off the axis, around it, degrees
ELSEWHERE = (35.0, 310.0)  # where a fit must foresee the picture
SIZE: dict[str, Any] = {"size_px": 240, "radius_px": 100.0, "irradiance": (1.0, 1.0, 1.0)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Landing:
    """One photograph of a measured material, and what the fit makes of it."""

    model: str
    here: float  # rms error of the picture that the fit implies, over that picture's rms
    elsewhere: float  # the same under another light
    flags: tuple[str, ...]

    @property
    def alarms(self) -> frozenset[str]:
        """The flags that say: do not believe these numbers."""
        return ALARMS.intersection(self.flags)


def measured(name: str) -> dict[str, Any]:
    """Mitsuba's description of a measured material."""
    return {"type": "measured", "filename": str(folder("measured_brdf") / f"{name}_rgb.bsdf")}


def landing(bsdf: Mapping[str, Any] | None, light: tuple[float, float], fit: Mapping[str, Any]) -> Landing:
    """Render, photograph, fit, foresee; `bsdf` None is the known material of `Ball`."""
    ball = _ball(light)
    with tempfile.TemporaryDirectory() as place:
        report = _fitted(ball, _picture(ball, bsdf), Path(place), fit)
    best = report.fits[report.best]
    return Landing(
        model=f"{best.model} over {best.diffuse}",
        here=_error(best, bsdf, light),
        elsewhere=_error(best, bsdf, ELSEWHERE),
        flags=tuple(str(flag) for flag in best.flags),
    )


def _fitted(ball: Ball, picture: Floats, place: Path, fit: Mapping[str, Any]) -> MaterialReport:
    sensor, path = camera.Sensor(), place / "ball.dng"
    shown = Render(
        width_px=ball.size_px,
        height_px=ball.size_px,
        origin_px=(0, 0),
        diffuse=picture,
        specular=np.zeros_like(picture),
        coverage=np.ones(picture.shape[:2]),
        background=np.zeros(3),
        pedestal=np.zeros(3),
    )
    exposure = camera.exposure_for(shown, highlight=0.8)
    rng = np.random.default_rng(1)
    samples = camera.mosaic(shown, exposure=exposure, noise=camera.GOOD_CAMERA, sensor=sensor, rng=rng)
    write_raw(path, samples, camera.GOOD_CAMERA, sensor, ball.scene.camera)
    told = exposed(ball.scene, exposure)
    write_scene_toml(Path(f"{path}.toml"), told, camera.with_rounding(camera.GOOD_CAMERA, sensor.step))
    return fit_material(path, resolve(path, flags=[Layer(name="the test", values={"fit": {"fix": ["all"], **fit}})]))


def _error(best: Fit, bsdf: Mapping[str, Any] | None, light: tuple[float, float]) -> float:
    """Rms error of the fitted material's picture under a light, over the true picture's rms, both without noise."""
    ball = _ball(light)
    there = _picture(ball, bsdf)
    ours = our_render(ball.scene, _material(best), width_px=ball.size_px, height_px=ball.size_px).radiance()
    return float(np.sqrt(np.sum((ours - there) ** 2) / np.sum(there**2)))


def _ball(light: tuple[float, float]) -> Ball:
    return Ball(light_off_axis_deg=light[0], light_around_deg=light[1], **SIZE)


def _picture(ball: Ball, bsdf: Mapping[str, Any] | None) -> Floats:
    return np.maximum(render(ball, bsdf=bsdf, samples=64), 0.0)  # colours beyond RGB's gamut are negative


def _material(best: Fit) -> Material:
    made = {name: value for name, value in best.colours.items() if name not in ("pedestal", "specular_scale")}
    if "specular_f0" in made:
        made.pop("specular_strength", None)
    return material(best.model, {**best.shape, **made}, diffuse=best.diffuse, variant=best.variant)


def main() -> None:
    """The table, as Markdown."""
    head = "| material | light off the axis | best of the main job | error | error under another light | alarms |"
    sys.stdout.write(f"{head}\n|---|---|---|---|---|---|\n")
    for name, light in product(MATERIALS, LIGHTS):
        of = landing(measured(name), light, {})
        alarms = ", ".join(f"`{flag}`" for flag in sorted(of.alarms))
        errors = " | ".join(f"{100 * error:.1f} %" for error in (of.here, of.elsewhere))
        sys.stdout.write(f"| {name} | {light[0]:g}° | {of.model} | {errors} | {alarms} |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
