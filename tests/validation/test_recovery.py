"""Photographs of known truth, through DNG files and back: the numbers are right and their intervals hold.

Sixty photographs of 1000 x 1000 pixels, three roughnesses and seeds 1 to 20, as a camera would write them, by a
supersampling renderer that shares nothing with the fit's sums.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from synthetic import camera
from synthetic.render import render
from synthetic.scenes import exposed
from tests.inference.ball import BODY, EXIF, F0, NOISE, glossy, scene_of
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.io.dng import write_dng
from toolkit.io.read import read_in_process
from toolkit.radiometry.linearise import linearise
from toolkit.records import Fit

ROUGHNESSES, SEEDS, SIZE_PX = (0.05, 0.12, 0.25), range(1, 21), 1000
COLOURS = {"diffuse_albedo": np.array(BODY), "specular_f0": np.full(3, F0)}


@cache
def photographed(roughness: float) -> tuple[Fit, ...]:
    """Fits of all seeds of one roughness; the calibration is free, with its prior, in half of them."""
    scene, sensor = scene_of(SIZE_PX), camera.Sensor()
    picture = render(scene, glossy(roughness_rad=roughness), width_px=SIZE_PX, height_px=SIZE_PX, supersample=8)
    factor = camera.exposure_for(picture, highlight=0.8)
    seen, fits = exposed(scene, factor), []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        samples = camera.mosaic(picture, exposure=factor, noise=NOISE, sensor=sensor, rng=rng)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "ball.dng"
            profile = camera.noise_profile(camera.with_rounding(NOISE, sensor.step))
            write_dng(
                path,
                samples,
                cfa=sensor.cfa,
                black=sensor.black_dn,
                white=sensor.white_dn,
                noise_profile=profile,
                **EXIF,
            )
            image = linearise(read_in_process(path))
        fixed = ("all",) if seed % 2 else ()
        cells = gather_for(image, seen)
        fits.append(infer(image, seen, cells, Model.named("torrance-sparrow"), seed=seed, fixed=fixed, effective=1000))
    return tuple(fits)


def pooled(roughness: float) -> tuple[np.ndarray, np.ndarray]:
    """Z scores and whether the 90 % interval holds the truth, of roughness, albedo and F0 of every photograph."""
    truth = {**COLOURS, "roughness_rad": np.array(roughness)}
    z, held = [], []
    for fit in photographed(roughness):
        for e in fit.parameters:
            if e.name in truth:
                z.append(np.ravel((e.estimate - truth[e.name]) / e.sd))
                low, high = e.interval_90
                held.append(np.ravel((low <= truth[e.name]) & (truth[e.name] <= high)))
    return np.concatenate(z), np.concatenate(held)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_every_number_is_within_its_error(roughness: float) -> None:
    """Every z within 5, and roughness within 0.5 % of the truth in every single photograph."""
    z, _ = pooled(roughness)
    assert np.abs(z).max() < 5.0
    for fit in photographed(roughness):
        assert fit.shape["roughness_rad"] == pytest.approx(roughness, rel=0.005)
        assert fit.status == "converged"
        assert fit.flags == ()


def test_the_stated_errors_are_the_real_ones() -> None:
    """Over all truths the mean of z^2 is 0.8 to 1.25, and 85 to 95 % of the 90 % intervals hold their truth."""
    z, held = (np.concatenate(part) for part in zip(*(pooled(r) for r in ROUGHNESSES), strict=True))
    assert 0.8 < np.mean(z**2) < 1.25
    assert 0.85 < np.mean(held) < 0.95
    assert not 0.8 < np.mean((1.25 * z) ** 2) < 1.25  # the control: sds a quarter too small would be noticed
