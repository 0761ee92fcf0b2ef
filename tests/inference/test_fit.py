"""The fit finds what made the photograph, says how well, and what it cannot know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize

from pipelines.validate.design import hypercube
from pipelines.validate.trial import run_trial
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.blocks import blocks_of
from toolkit.inference.fit import fit
from toolkit.inference.gather import gather
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.inference.normal import Prior
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.problem import pose
from toolkit.inference.settle import fit_with_shifts
from toolkit.inference.solving import bounded, bounded_each, inverse
from toolkit.inference.weights import Weights
from toolkit.records import Fit, Scene

from .ball import BODY, F0, NOISE, photograph, radiance_of


def _estimate(found: Fit, name: str) -> np.ndarray:
    return np.asarray(next(e.estimate for e in found.parameters if e.name == name))


def test_agrees_with_a_plain_least_squares_over_every_number() -> None:
    """Variable projection ends where scipy's trust-region solver ends on all unknowns at once."""
    radiance, scene = radiance_of(200)
    image = photograph(radiance, seed=1)
    problem = pose(Model.named("torrance-sparrow"), scene, gather(image, scene), NOISE)
    optimum = fit(problem)
    root = np.sqrt(np.diag(problem.prior.precision))

    def residual(p: np.ndarray) -> np.ndarray:
        predicted = problem.predict(problem.columns(p[:1]), p[1:])
        parts = [
            _white(w, data.value - r)
            for w, data, r in zip(optimum.weights.weights, problem.channels, predicted, strict=True)
        ]
        return np.concatenate([*parts, root * p[1:]])

    start = np.concatenate([optimum.u + 0.05, optimum.x * 1.02])
    plain = scipy.optimize.least_squares(residual, start, x_scale="jac", xtol=1e-12, ftol=1e-12)
    sd = np.sqrt(np.diag(inverse(optimum.joint)))
    assert abs(plain.x[0] - optimum.u[0]) < 0.02 * sd[-1]
    assert np.all(np.abs(plain.x[1:] - optimum.x) < 0.02 * sd[:-1])


def _white(weights: Weights, residual: np.ndarray) -> np.ndarray:
    """Residuals made independent and of unit variance, as the weights' own docstring has it."""
    mean, x, y = residual.reshape(3, -1)
    slopes = x - weights.lean[0] * mean, y - weights.lean[1] * mean
    white = np.sqrt(weights.each) * np.concatenate([mean, *slopes])
    assert white @ white == pytest.approx(residual @ weights.times(residual))
    return white


@pytest.mark.parametrize(
    ("model", "shape"),
    [
        ("torrance-sparrow", {"roughness_rad": 0.12}),
        ("beckmann", {"alpha": 0.2}),
        ("ggx", {"alpha": 0.15}),
        ("phong", {"shininess": 30.0}),
        ("blinn-phong", {"shininess": 200.0}),
    ],
)
def test_finds_the_material_of_a_photograph(model: str, shape: dict[str, float]) -> None:
    """Each lobe of the main job: every number within five sds of the truth, the mean square of z near 1."""
    radiance, scene = radiance_of(300, model, **shape)
    image = photograph(radiance, seed=2)
    found = infer(image, scene, gather_for(image, scene), Model.named(model), seed=1)
    assert found.status == "converged"
    truth = {**shape, "diffuse_albedo": np.array(BODY)}
    truth |= (
        {"specular_albedo": np.full(3, 0.1)} if "specular_albedo" in found.colours else {"specular_f0": np.full(3, F0)}
    )
    z = np.concatenate(
        [np.atleast_1d((e.estimate - truth[e.name]) / e.sd) for e in found.parameters if e.name in truth]
    )
    assert np.all(np.abs(z) < 5)
    assert np.mean(z**2) < 3.0
    assert found.chi2_reduced == pytest.approx(1.0, abs=0.05)


def test_a_wrong_truth_would_be_noticed() -> None:
    """The control of the test above: half a percent of roughness is many sds."""
    radiance, scene = radiance_of(300)
    image = photograph(radiance, seed=2)
    found = infer(image, scene, gather_for(image, scene), Model.named("torrance-sparrow"), seed=1)
    roughness = found.parameters[0]
    assert abs(float(roughness.estimate) - 0.12 * 1.005) > 5 * float(roughness.sd)


def test_without_irradiance_only_the_product_of_f0_and_scale_is_told() -> None:
    """One far light and an unknown scale: the strength is an estimate, F0 is none and says why."""
    radiance, scene = radiance_of(300)
    image = photograph(radiance, seed=1)
    light = DirectionalLight(direction=scene.lights[0].direction)
    relative = replace(scene, lights=(light,), scale="relative")
    found = infer(image, relative, gather_for(image, scene), Model.named("torrance-sparrow"), seed=1)
    f0 = next(e for e in found.parameters if e.name == "specular_f0")
    assert f0.estimate is None
    assert "second light" in f0.note
    assert "not_identified" in found.flags
    assert {e.name for e in found.parameters if e.flags} == {"specular_f0"}
    irradiance = np.asarray(scene.lights[0].irradiance)
    assert _estimate(found, "diffuse_albedo") == pytest.approx(np.array(BODY) * irradiance, rel=0.005)
    assert next(e.unit for e in found.parameters if e.name == "diffuse_albedo") == "relative"


def test_a_bound_is_told_of_the_parameter_that_rests_on_it() -> None:
    """A Lambertian body fitted as Oren and Nayar's: its roughness is none, and nothing else lies at a bound."""
    radiance, scene = radiance_of(200)
    image = photograph(radiance, seed=1)
    model = Model.named("torrance-sparrow", "oren-nayar")
    found = infer(image, scene, gather_for(image, scene), model, seed=1)
    assert "near_bound" in found.flags
    assert {e.name for e in found.parameters if "near_bound" in e.flags} == {"diffuse_roughness_rad"}


@pytest.mark.parametrize(
    ("wrong", "amount"),
    [("light", 0.5), ("radius", 1.0), ("centre", 1.0), ("nearness", 1 / 30)],
)
def test_a_wrong_calibration_within_its_sd_does_no_harm(wrong: str, amount: float) -> None:
    """With the calibration free, a light off by 0.5 degrees, a radius off by 1 px ... leave every z in order."""
    radiance, scene = radiance_of(300)
    if wrong == "nearness":
        from synthetic.camera import exposure_for
        from synthetic.render import render
        from synthetic.scenes import exposed
        from toolkit.geometry.lights import PointLight

        from .ball import glossy, scene_of

        away = scene_of(300)
        place = tuple(30.0 * v for v in away.lights[0].direction)
        near = replace(away, lights=(PointLight(position=place, irradiance=(3.0, 3.0, 3.0)),))
        picture = render(near, glossy(), width_px=300, height_px=300, supersample=8)
        factor = exposure_for(picture, highlight=0.8)
        radiance, scene = picture.radiance() * factor, exposed(away, factor)
    image = photograph(radiance, seed=4)
    told = _told(scene, wrong, amount)
    problem = pose(Model.named("torrance-sparrow"), told, gather_for(image, told), NOISE)
    naive, _ = fit_with_shifts(problem, shifts_of(told, ("all",)))
    honest, shifts = fit_with_shifts(problem, shifts_of(told))
    assert np.abs(_z(honest)).max() < 5
    assert np.mean(_z(honest) ** 2) < 3
    assert np.abs(_z(naive)).max() > 8  # the control: taken at its word, the calibration spoils the answer
    assert np.all(np.isfinite(shifts))


@pytest.mark.parametrize("number", [27, 33, 75, 104])
def test_two_bodies_beyond_lambert_are_found_though_the_search_begins_far_off(tmp_path: Path, number: int) -> None:
    """Oren-Nayar and Wolff: no descent stays on a range's end or in a wrong calibration; z of these was 6 to 14."""
    trial = hypercube(112)[number]
    line = run_trial(trial, tmp_path)
    assert trial.diffuse != "lambert"
    assert max(abs(n["truth"] - n["mean"]) / n["sd"] for n in line["numbers"]) < 4.0


@pytest.mark.parametrize("number", [9, 13])
def test_a_small_ball_in_little_noise_settles(tmp_path: Path, number: int) -> None:
    """Columns of the calibration taken from nodes that are not each channel's own left these creeping for ever."""
    assert "not_converged" not in run_trial(hypercube(1050)[number], tmp_path)["flags"]


@pytest.mark.parametrize("model", ["beckmann", "ggx"])
@pytest.mark.parametrize("alpha", [0.9, 0.95])
def test_a_lobe_at_the_end_of_its_range_is_found(model: str, alpha: float) -> None:
    """Within an eighth of its range's end all shapes of the search but the last want no specular light at all."""
    radiance, scene = radiance_of(110, model, light_deg=20.0, alpha=alpha)
    image = photograph(radiance, seed=1)
    optimum = fit(pose(Model.named(model), scene, gather_for(image, scene), NOISE))
    assert np.exp(optimum.u[0]) == pytest.approx(alpha, rel=0.02)


def test_a_wrong_model_settles_on_few_cells_where_it_does_on_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """GGX fitted by Beckmann moves sphere and light, and its data weigh less: the same from few cells as from all."""
    radiance, scene = radiance_of(300, "ggx", alpha=0.15)
    image = photograph(radiance, seed=3)
    cells, shifts = gather_for(image, scene), shifts_of(scene)
    problem, blocks = pose(Model.named("beckmann"), scene, cells, NOISE), (blocks_of(scene, cells),)
    few, there = fit_with_shifts(problem, shifts, blocks)
    monkeypatch.setattr("toolkit.inference.search.SEARCH_CELLS", 10 * len(cells.x_px))
    whole, elsewhere = fit_with_shifts(problem, shifts, blocks)
    sd, named = np.sqrt(np.diag(inverse(whole.joint))), len(whole.problem.layout.names)
    assert whole.problem.tempering > 5.0
    assert few.problem.tempering == pytest.approx(whole.problem.tempering, rel=0.06)
    assert np.all(np.abs(there - elsewhere) < 0.1 * sd[named : named + len(there)])
    assert np.all(np.abs(few.x[:named] - whole.x[:named]) < 0.1 * sd[:named])
    assert np.abs(few.u - whole.u) < 0.1 * sd[-1]


def _told(scene: Scene, wrong: str, amount: float) -> Scene:
    sphere = replace(scene.sphere, covariance_px2=np.eye(3))
    light = scene.lights[0].model_copy(update={"direction_sd_deg": 0.5})
    if wrong == "light":
        turn = np.array([np.cos(0.7), np.sin(0.7), 0.0]) * np.radians(amount)
        x, y, z = np.asarray(light.direction) + turn
        light = DirectionalLight(direction=(x, y, z), direction_sd_deg=0.5, irradiance=light.irradiance)
    if wrong == "radius":
        sphere = replace(sphere, radius_px=sphere.radius_px + amount)
    if wrong == "centre":
        sphere = replace(sphere, centre_px=(sphere.centre_px[0] + amount, sphere.centre_px[1]))
    return replace(scene, sphere=sphere, lights=(light,))


def _z(optimum: object) -> np.ndarray:
    layout, sd = optimum.problem.layout, np.sqrt(np.diag(inverse(optimum.joint)))
    truth = {"diffuse_albedo": np.array(BODY), "specular_f0": np.full(3, F0)}
    x, s = optimum.x, sd[: layout.size]
    z = [(layout.of(name, x) - value) / layout.of(name, s) for name, value in truth.items()]
    return np.concatenate([*z, (optimum.u - np.log(0.12)) / sd[layout.size :]])


def test_the_bounded_solution_is_scipys() -> None:
    """The active set ends where scipy's bounded least squares ends, for one system as for several at once."""
    rng = np.random.default_rng(8)
    for _ in range(50):
        a, b = rng.standard_normal((12, 5)), rng.standard_normal(12)
        prior = Prior(precision=np.zeros((5, 5)), centre=np.zeros(5), low=np.zeros(5), high=np.full(5, 0.4))
        x, on_bound = bounded(a.T @ a, a.T @ b, prior)
        truth = scipy.optimize.lsq_linear(a, b, (0.0, 0.4), tol=1e-12).x
        assert x == pytest.approx(truth, abs=1e-5)
        assert np.array_equal(on_bound, (x <= 0) | (x >= 0.4))
        each = bounded_each(np.stack([a.T @ a, np.eye(5)]), np.stack([a.T @ b, np.full(5, 0.2)]), prior)
        assert each == pytest.approx(np.stack([truth, np.full(5, 0.2)]), abs=1e-5)
