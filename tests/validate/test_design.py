"""The designed set reaches everywhere, is the same everywhere, and breaks what it says it breaks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.validate.broken import ASSUMPTIONS, as_asked
from pipelines.validate.design import LINEAR, MODELS, RANGES, RENDERS, designed, fingerprint, hypercube
from pipelines.validate.shot import SENSOR, Shot, shoot, write
from synthetic.ellipsoid import ellipsoid
from toolkit.io.read import read


def test_every_slice_of_every_range_is_used_once() -> None:
    """A Latin hypercube: of n renders, one in each n-th of every number's range."""
    trials = hypercube(70, seed=4)
    for name, (low, high) in RANGES.items():
        values = np.array([trial.scene[name] for trial in trials])
        share = (
            (values - low) / (high - low) if name in LINEAR or low == 0 else np.log(values / low) / np.log(high / low)
        )
        assert sorted(np.clip((share * 70).astype(int), 0, 69)) == pytest.approx(list(range(70)), abs=1), name


def test_a_preset_is_what_it_says_and_the_same_each_time() -> None:
    """Clean renders of every model, each assumption by each amount; the same seed gives the same trials."""
    trials = designed("quick")
    clean = [trial for trial in trials if not trial.broken]
    assert len(clean) == RENDERS["quick"] >= 100
    assert {(trial.model, trial.diffuse) for trial in clean} == set(MODELS)
    rows = {(trial.broken, trial.amount) for trial in trials if trial.broken}
    assert rows == {(name, amount) for name, one in ASSUMPTIONS.items() for amount in one.amounts}
    assert fingerprint(designed("quick")) == fingerprint(trials) != fingerprint(designed("quick", seed=1))
    assert [trial.number for trial in trials] == list(range(len(trials)))


@pytest.fixture(scope="module")
def shot() -> Shot:
    """A small ball with every assumption kept."""
    return shoot(hypercube(1, seed=2)[0])


@pytest.mark.parametrize(
    ("name", "amount"), [(name, amount) for name, one in ASSUMPTIONS.items() for amount in one.amounts]
)
def test_an_assumption_is_broken_by_as_much_as_is_said(shot: Shot, name: str, amount: float) -> None:
    """Measured on the broken shot itself."""
    broken = as_asked(shot, name, amount)
    assert _measured(shot, broken, name) == pytest.approx(amount, rel=0.15)
    assert as_asked(shot, "", 0.0) is shot


def _measured(whole: Shot, broken: Shot, name: str) -> float:
    before, after = whole.picture.box_radiance(), broken.picture.box_radiance()
    inside = whole.picture.coverage == 1.0
    body = whole.picture.diffuse[inside]
    if name == "light":
        a, b = (np.array(shot.told.lights[0].direction) for shot in (whole, broken))
        return float(np.degrees(np.arccos(a @ b)))
    if name == "radius":
        return broken.told.sphere.radius_px - whole.told.sphere.radius_px
    if name == "gamma":
        return broken.gamma
    if name == "demosaiced":
        return float(broken.demosaiced)
    if name == "clipped":
        return float(100 * np.mean(broken.exposure * after[inside] >= 1.0))
    if name == "stray":
        return float(100 * (after - before)[inside].mean() / whole.picture.diffuse.max())
    if name == "texture":
        lit = body > 0.2 * body.max()
        return float(100 * np.std(broken.picture.diffuse[inside][lit] / body[lit]))
    if name == "lamp":  # what it adds, against what it would add as strong as the first
        full = as_asked(whole, "lamp", 100.0).picture.box_radiance()
        return float(100 * (after - before).sum() / (full - before).sum())
    rows, columns = np.nonzero(broken.picture.coverage > 0.5)
    spread = np.linalg.eigvalsh(np.cov(rows, columns))
    return float(100 * (np.sqrt(spread[1] / spread[0]) - 1.0))


def test_an_ellipsoid_that_is_not_stretched_is_the_sphere(shot: Shot) -> None:
    """Two renderers that share only the lobes agree to the fineness of the plainer one."""
    round_one = ellipsoid(shot.picture, shot.scene, shot.material, stretch=0.0, around_deg=30.0)
    one, other = round_one.radiance(), replace(shot.picture, pedestal=np.zeros(3)).radiance()
    assert np.abs(one - other).mean() < 2e-3 * other.max()
    deep = shot.picture.full(shot.picture.coverage[..., None])[..., 0] == 1.0
    assert np.median(np.abs(one - other)[deep] / np.maximum(other[deep], 1e-3 * other.max())) < 1e-3


def test_an_error_of_black_is_an_offset_and_no_gain(tmp_path: Path, shot: Shot) -> None:
    """The same photograph with black 0.01 higher differs by 0.01 in bright samples and in dark ones alike."""
    quiet = replace(shot.noise, gain=np.zeros(3), read=np.zeros(3))
    still = replace(shot, noise=quiet)
    low, high = (
        SENSOR.step * read(write(replace(still, black_error=error), tmp_path, f"black {error}")[0]).values.astype(float)
        for error in (0.0, 0.01)
    )
    assert np.ptp(low) > 0.2
    assert high - low == pytest.approx(np.full(low.shape, 0.01), abs=1.5 * SENSOR.step)


def test_what_is_told_differs_from_what_is_by_the_stated_error(tmp_path: Path) -> None:
    """Over many trials the light is told wrongly by its own sd about each of two axes, the sphere by its own."""
    trials, light, place = hypercube(12, seed=9), [], []
    for trial in trials:
        shot = shoot(trial)
        angle = np.arccos(np.dot(shot.scene.lights[0].direction, shot.told.lights[0].direction))
        light.append((np.degrees(angle) / trial.scene["light_sd_deg"]) ** 2 / 2)
        off = np.subtract(shot.told.sphere.centre_px, shot.scene.sphere.centre_px) / trial.scene["place_sd_px"]
        place.append(np.mean(off**2))
    assert np.mean(light) == pytest.approx(1.0, abs=0.8)
    assert np.mean(place) == pytest.approx(1.0, abs=0.8)
    path, truth = write(shot, tmp_path, "one")
    assert read(path).format == "raw"
    assert set(trials[-1].parameters) <= set(truth)
