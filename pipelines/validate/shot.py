"""The photograph of a trial, and what its user is told of the scene: right within the stated errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from synthetic import camera as cam
from synthetic.files import write_png
from synthetic.materials import Material, material
from synthetic.photograph import truth, write_raw
from synthetic.render import Render, render
from synthetic.scenes import as_measured, direction, exposed, sphere_in, write_scene_toml
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.priors import PEDESTAL_SD
from toolkit.records import Floats, Noise, Scene

from .design import Trial

MARGIN = 1.15  # the frame's half side in sphere radii
SENSOR = cam.Sensor()


@dataclass(frozen=True, kw_only=True, eq=False)
class Shot:
    """A ball as it is (`scene`, `picture`), and the scene as its user believes it to be (`told`)."""

    scene: Scene
    told: Scene
    material: Material
    noise: Noise
    picture: Render
    exposure: float
    seed: int
    black_error: float = 0.0  # image units by which the level of no light lies above what the file says
    gamma: float = 1.0  # of a curve that the samples went through and nobody mentions
    demosaiced: bool = False  # stored as the interpolated RGB picture of a raw converter

    @cached_property
    def rng(self) -> np.random.Generator:
        """What the breaking of an assumption is drawn from; calibration and noise have their own."""
        return np.random.default_rng([self.seed, 2])

    @property
    def suffix(self) -> str:
        """What the photograph's name ends in."""
        return ".png" if self.demosaiced else ".dng"


def shoot(trial: Trial) -> Shot:
    """The trial's ball, rendered, with every assumption kept."""
    if trial.setup is not None:
        from .setup import shoot_setup

        return shoot_setup(trial, trial.setup)
    there = trial.scene
    side = 2 * int(np.ceil(MARGIN * there["radius_px"]))
    light = DirectionalLight(
        direction=direction(there["light_off_axis_deg"], there["light_around_deg"]),
        direction_sd_deg=there["light_sd_deg"],
        irradiance=(1.0, 1.0, 1.0),
    )
    rng = np.random.default_rng([trial.seed, 1])
    off_x, off_y = rng.uniform(-1.0, 1.0, 2)
    scene = sphere_in(
        side,
        side,
        radius_px=there["radius_px"],
        lights=(light,),
        offset_px=(float(off_x), float(off_y)),
        centre_sd_px=there["place_sd_px"],
        radius_sd_px=there["place_sd_px"],
    )
    made_of = material(trial.model, trial.parameters, diffuse=trial.diffuse)
    picture = render(scene, made_of, width_px=side, height_px=side)
    exposure = cam.exposure_for(picture, highlight=there["highlight"])
    return Shot(
        scene=scene,
        told=as_measured(scene, rng),
        material=made_of,
        noise=noise_of(there["electrons"], there["read_electrons"]),
        picture=picture,
        exposure=exposure,
        black_error=_black_error(there["black_error"], picture) * exposure,
        seed=trial.seed,
    )


def _black_error(quantile: float, picture: Render) -> float:
    """An error of the black level, as radiance, from the very distribution that a fit allows for."""
    from scipy.stats import norm

    return float(norm.ppf(quantile)) * PEDESTAL_SD * float(np.quantile(picture.box_radiance(), 0.99))


def noise_of(electrons: float, read_electrons: float) -> Noise:
    """The noise of a sensor that holds `electrons` at saturation, image units."""
    return Noise(gain=np.full(3, 1.0 / electrons), read=np.full(3, read_electrons / electrons), source="given")


def write(shot: Shot, folder: Path, name: str) -> tuple[Path, dict[str, Any]]:
    """The photograph, with its user's scene file beside it; returns where, and the truth by a result's names."""
    path, rng = folder / f"{name}{shot.suffix}", np.random.default_rng(shot.seed)
    samples = cam.mosaic(shot.picture, exposure=shot.exposure, noise=shot.noise, sensor=_raised(shot), rng=rng)
    samples = np.minimum(samples, SENSOR.white_dn)
    levels = np.clip((samples.astype(float) - SENSOR.black_dn) * SENSOR.step, 0.0, 1.0)
    if shot.gamma != 1.0:
        samples = cam.digitise(levels ** (1.0 / shot.gamma), SENSOR)
    if shot.demosaiced:
        write_png(path, _interpolated(levels))
    else:
        write_raw(path, samples, shot.noise, SENSOR, shot.scene.camera)
    rounded = cam.with_rounding(shot.noise, SENSOR.step)
    absolute = shot.scene.scale == "absolute"
    write_scene_toml(Path(f"{path}.toml"), exposed(shot.told, shot.exposure), rounded, irradiance=absolute)
    seen = exposed(shot.scene, shot.exposure)
    found = truth(seen, shot.material, rounded)["parameters"]
    return path, found if absolute else _relative(found, np.asarray(seen.lights[0].irradiance))


def _raised(shot: Shot) -> cam.Sensor:
    """The sensor with all its levels raised by the error of black: an offset, and no other gain."""
    by_dn = round(shot.black_error / SENSOR.step)
    return replace(SENSOR, black_dn=SENSOR.black_dn + by_dn, white_dn=SENSOR.white_dn + by_dn)


def _relative(parameters: Mapping[str, Any], irradiance: Floats) -> dict[str, Any]:
    """The truth in units of the unknown scale; F0 is then no number that a fit could find."""
    scaled = ("diffuse_albedo", "specular_albedo", "specular_strength")
    return {
        name: (irradiance * np.asarray(value)).tolist() if name in scaled else value
        for name, value in parameters.items()
        if name != "specular_f0"
    }


def _interpolated(levels: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """16-bit codes as a raw converter's "linear" export has them: two thirds of them made up."""
    import cv2

    return np.asarray(cv2.cvtColor(np.rint(levels * 65535.0).astype(np.uint16), cv2.COLOR_BayerRGGB2RGB))
