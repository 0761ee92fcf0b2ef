"""Cells hold the photograph: nothing is lost, nothing biased, nothing flagged gets in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

from toolkit.flags import SampleFlag
from toolkit.inference import gather as module
from toolkit.inference.cells import Cells
from toolkit.inference.descend import project
from toolkit.inference.fit import fit
from toolkit.inference.gather import NEARNESS_SD, gather
from toolkit.inference.infer import gather_for
from toolkit.inference.lit import lit_by
from toolkit.inference.model import Model
from toolkit.inference.moved_light import moved
from toolkit.inference.normal import weigh
from toolkit.inference.problem import Optimum, pose
from toolkit.inference.solving import inverse
from toolkit.inference.weights import weights_of
from toolkit.records import LinearImage, Plane, Scene
from toolkit.reflectance import LOBES

from .ball import NOISE, photograph, radiance_of, replace_light
from .every import every_sample


@pytest.mark.parametrize("mosaic", [False, True])
def test_each_usable_sample_is_in_one_cell(mosaic: bool) -> None:
    """The counts of the cells add up to the lit samples of the sphere, within its rim."""
    radiance, scene = radiance_of(300)
    cells = gather(photograph(radiance, seed=0, mosaic=mosaic), scene)
    y, x = np.mgrid[:300, :300].astype(float)
    lit = lit_by(scene, x, y)[0].cosines
    inside = (lit.n_dot_v > module.MIN_N_DOT_V) & (lit.n_dot_l > module.MIN_N_DOT_L)
    share = [1 / 4, 1 / 2, 1 / 4] if mosaic else [1, 1, 1]
    for data, part in zip(cells.channels, share, strict=True):
        assert data.count[: data.cells].sum() == pytest.approx(part * inside.sum(), rel=0.02)


@pytest.mark.parametrize("mosaic", [False, True])
def test_the_nodes_predict_mean_and_slopes_of_the_samples(mosaic: bool) -> None:
    """A rendered lobe, averaged over pixels and cells, agrees with what each cell's nodes tell of it."""
    radiance, scene = radiance_of(400, roughness_rad=0.08)
    clean = replace(NOISE, gain=np.full(3, 1e-12), read=np.full(3, 1e-9))
    cells = gather(photograph(radiance, seed=0, noise=clean, mosaic=mosaic), scene)
    lit = lit_by(scene, *cells.nodes())[0]
    specular = LOBES["torrance-sparrow"].value(lit.cosines, (0.08,)) * (0.04 * (1 - lit.schlick) + lit.schlick)
    diffuse = LOBES["lambert"].value(lit.cosines, ())
    for channel, albedo in enumerate((0.45, 0.2, 0.08)):
        data = cells.channels[channel]
        predicted = data.predicted(lit.colour[channel] * (albedo * diffuse + specular))
        error = np.abs(predicted - data.value)[data.count > 0] / radiance.max()
        assert error[: data.cells].max() < 1e-5
        assert error[data.cells :].max() < 4e-5


def test_no_cell_is_in_shadow_if_the_light_is_nearer_than_told() -> None:
    """Two sds nearer and two sds aside, a light that is told as far shines on less of the ball."""
    radiance, scene = radiance_of(200, light_deg=65.0)
    light = scene.lights[0].model_copy(update={"direction_sd_deg": 0.8})
    told = replace(scene, lights=(light,))
    cells = gather_for(photograph(radiance, seed=0), told)
    for aside in (-1.0, 1.0):
        turn_rad = (2.0 * aside * np.radians(0.8), 0.0)
        there = replace(told, lights=(moved(light, turn_rad=turn_rad, nearer_per_radius=2.0 * NEARNESS_SD),))
        assert lit_by(there, cells.x_px, cells.y_px)[0].cosines.n_dot_l.min() > 0.0


@pytest.mark.parametrize("slopes", [True, False])
def test_a_channel_without_cells_counts_for_nothing(slopes: bool) -> None:
    """Some of none are none, and so are their weights."""
    radiance, scene = radiance_of(120)
    cells = gather(photograph(radiance, seed=0), scene)
    none = np.zeros(0, np.intp)
    empty = cells.channels[0].only(none, none, slopes=slopes)
    assert empty.only(none, none, slopes=slopes).value.shape == (0,)
    weights = weights_of(empty, NOISE, 0, empty.predicted(np.ones_like(cells.node_x_px)))
    assert (weights.counted, weights.of_means.shape) == (0, (0,))


def test_flagged_samples_take_no_part() -> None:
    """Spoiled samples that are flagged change no cell's value; only the number of samples falls."""
    radiance, scene = radiance_of(300)
    image = photograph(radiance, seed=0, mosaic=False)
    spoiled = _spoil(image)
    clean, holed = gather(image, scene), gather(spoiled, scene)
    for c in range(3):
        assert _samples(holed, c) < _samples(clean, c)
        assert np.abs(holed.channels[c].value).max() < 10.0


def test_a_sample_that_is_no_number_is_refused_unless_flagged() -> None:
    """One NaN says so where cells are gathered, not as a fit that converges to NaN; flagged it takes no part."""
    radiance, scene = radiance_of(300)
    first, *others = photograph(radiance, seed=0, mosaic=False).planes
    values, flags = first.values.copy(), first.flags.copy()
    values[150, 150], flags[150, 150] = np.nan, SampleFlag.INVALID
    image = replace(photograph(radiance, seed=0), planes=(replace(first, values=values, flags=flags), *others))
    assert np.isfinite(gather(image, scene).channels[0].value).all()
    with pytest.raises(ValueError, match="NaN"):
        gather(replace(image, planes=(replace(first, values=values), *others)), scene)


@pytest.mark.parametrize(
    ("sphere", "light"),
    [
        ({}, {"direction": (0.0, 0.0, -1.0), "direction_sd_deg": 20.0}),
        ({"centre_px": (-900.0, -900.0)}, {}),
        ({"covariance_px2": np.eye(3) * 2500.0}, {}),
    ],
    ids=["lit from behind", "out of the picture", "who knows where"],
)
def test_a_ball_of_which_nothing_is_usable_has_no_cells(sphere: dict[str, object], light: dict[str, object]) -> None:
    """None, not an error and not the middle of the picture; what to tell is the caller's to say."""
    radiance, scene = radiance_of(200)
    nowhere = replace_light(replace(scene, sphere=replace(scene.sphere, **sphere)), **light)
    assert len(gather(photograph(radiance, seed=0, mosaic=False), nowhere).x_px) == 0


def test_a_strip_of_a_ball_has_cells() -> None:
    """Six rows of a large one: not as high as the blocks whose moments are worked out all over the picture."""
    radiance, scene = radiance_of(300)
    strip = photograph(radiance[147:153], seed=0, mosaic=False)
    x, y = scene.sphere.centre_px
    assert len(gather(strip, replace(scene, sphere=replace(scene.sphere, centre_px=(x, y - 147.0)))).x_px) > 60


def test_unflagged_spoiling_would_show() -> None:
    """The control of the test above: the same samples unflagged do change cells."""
    radiance, scene = radiance_of(300)
    planes = tuple(
        replace(plane, flags=np.zeros_like(plane.flags)) for plane in _spoil(photograph(radiance, seed=0)).planes
    )
    cells = gather(replace(photograph(radiance, seed=0), planes=planes), scene)
    assert max(data.means.max() for data in cells.channels) > 10.0


@pytest.mark.parametrize("roughness", [0.02, 0.1])
def test_cells_cost_less_than_a_thirtieth_of_an_sd(roughness: float) -> None:
    """A fit to cells and a fit to every single one of their samples differ by less than 0.03 posterior sd.

    The control: the means of the same cells without their slopes lose more than that.
    """
    radiance, scene = radiance_of(256, roughness_rad=roughness)
    image = photograph(radiance, seed=3, mosaic=False)
    cells = gather_for(image, scene)
    every = _fit(image, scene, every_sample(image, cells))
    sd = np.sqrt(np.diag(inverse(every.joint)))
    assert _apart(_fit(image, scene, cells), every, sd) < 0.03
    assert _apart(_fit(image, scene, cells.thinned(1)), every, sd) > 0.06


def _apart(one: Optimum, other: Optimum, sd: np.ndarray) -> float:
    return float(np.max(np.abs(np.append(one.x - other.x, one.u - other.u)) / sd))


def test_a_clipped_highlight_is_told_from_below() -> None:
    """Clipped samples as lower bounds: the strength of a highlight whose core is lost stays within its error.

    The control: taken at face value, the clipped core costs the strength many sds.
    """
    radiance, scene = radiance_of(300, roughness_rad=0.08)
    white = 0.5
    image = _clipped(photograph(radiance, seed=2, mosaic=False), white, honest=True)
    bounded = _fit(image, scene, gather(image, scene))
    assert bounded.problem.channels[0].censored.sum() > 100
    assert abs(_strength_z(bounded)) < 4
    naive = _clipped(image, white, honest=False)
    assert abs(_strength_z(_fit(naive, scene, gather(naive, scene)))) > 10


def test_clipped_samples_lie_on_their_sides_where_a_shape_is_solved_for() -> None:
    """At one shape the linear unknowns minimise the one-sided sum of squares, as scipy does from elsewhere."""
    radiance, scene = radiance_of(200, roughness_rad=0.08)
    image = _clipped(photograph(radiance, seed=2, mosaic=False), 0.5, honest=True)
    optimum = _fit(image, scene, gather(image, scene))
    problem, u = optimum.problem, optimum.u + 0.3  # too wide a highlight: elsewhere too low, elsewhere too high
    here = project(problem, u, weigh(optimum.weights.weights, problem.extras))
    root = np.sqrt(np.diag(problem.prior.precision))

    def residual(x: np.ndarray) -> np.ndarray:
        found = [root * (x - problem.prior.centre)]
        for w, data, p in zip(here.weights.weights, problem.channels, problem.predict(here.columns, x), strict=True):
            left = data.value - p
            short = np.maximum(left[w.clipped], 0.0) * np.sqrt(w.short)
            left[w.clipped] = 0.0
            each = w.each.copy()
            each[w.clipped] = 0.0
            found += [short, np.sqrt(each) * w.apart(left)]
        return np.concatenate(found)

    sides = [w.each[w.clipped] > 0.0 for w in here.weights.weights]
    assert any(side.any() and not side.all() for side in sides)
    plain = scipy.optimize.least_squares(residual, optimum.x * 1.3, x_scale="jac", xtol=1e-12, ftol=1e-12)
    assert here.chi2 == pytest.approx(2.0 * plain.cost, rel=1e-6)
    assert here.x == pytest.approx(plain.x, rel=1e-3, abs=1e-5)


def _samples(cells: Cells, channel: int) -> float:
    data = cells.channels[channel]
    return float(data.count[: data.cells].sum())


def _clipped(image: LinearImage, white: float, *, honest: bool) -> LinearImage:
    planes = tuple(
        replace(
            p, values=np.minimum(p.values, np.float32(white)), flags=(honest & (p.values >= white)).astype(np.uint8)
        )
        for p in image.planes
    )
    return replace(image, planes=planes)


def _strength_z(optimum: Optimum) -> float:
    layout, sd = optimum.problem.layout, np.sqrt(np.diag(inverse(optimum.joint)))[:-1]
    return float(np.max(np.abs((layout.of("specular_f0", optimum.x) - 0.04) / layout.of("specular_f0", sd))))


def _fit(image: LinearImage, scene: Scene, cells: Cells) -> Optimum:
    return fit(pose(Model.named("torrance-sparrow"), scene, cells, image.noise))


def _spoil(image: LinearImage) -> LinearImage:
    rng = np.random.default_rng(5)

    def spoil(plane: Plane) -> Plane:
        bad = rng.random(plane.values.shape) < 0.01
        return replace(
            plane,
            values=np.where(bad, np.float32(1e6), plane.values),
            flags=np.where(bad, SampleFlag.INVALID, 0).astype(np.uint8),
        )

    return replace(image, planes=tuple(spoil(plane) for plane in image.planes))
