"""What the figures are drawn from: the light's plane, the bins, the block means, the tone curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.report.figures.cluster import skewed_t
from pipelines.report.figures.corner_plot import corner_plot
from pipelines.report.figures.highlight import highlight
from pipelines.report.figures.pictures import pictures, sample_sd
from pipelines.report.figures.plane import angle_deg, binned, light_line, positions
from pipelines.report.figures.profile import whole_ball
from pipelines.report.figures.shrink import shrunk, small
from pipelines.report.figures.tone import tone_of
from pipelines.srgb import light_of
from tests.pipelines import fakes
from toolkit.geometry.lights import DirectionalLight
from toolkit.geometry.sphere import surface
from toolkit.inference.layers import predict
from toolkit.records import Camera, MaterialReport, ModelLayers, Scene


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report(width_px=640, height_px=480)


@pytest.fixture(scope="module")
def layers(report: MaterialReport) -> ModelLayers:
    assert report.layers is not None
    return report.layers


PERSPECTIVE = Camera(projection="perspective", focal_length_px=300.0, principal_point_px=(100.0, 80.0))


@pytest.mark.parametrize("camera", [Camera(), PERSPECTIVE])
def test_the_highlight_stands_where_the_line_says(camera: Camera) -> None:
    """On the line, the surface at the mirror angle halves light and view, and all normals lie in the light's plane."""
    scene: Scene = replace(fakes.scene(), camera=camera)
    line = light_line(scene)
    x, y = positions(scene, line, np.linspace(-0.8, 0.8, 201))
    at = surface(camera, scene.sphere, x, y)
    light = np.array(fakes.LIGHT.direction)
    across = np.cross(light, line.view)
    np.testing.assert_allclose(at.normal @ across / np.linalg.norm(across), 0.0, atol=2e-3)
    half = light + at.view
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    best = int(np.argmax(np.sum(at.normal * half, axis=-1)))
    if camera.projection == "orthographic":
        assert angle_deg(scene, line, x, y)[best] == pytest.approx(line.half_deg, abs=0.5)
    assert line.light_deg == pytest.approx(np.degrees(np.arccos(light @ line.view)))


def test_a_light_beside_the_camera_still_has_a_line() -> None:
    """Any plane through the view will do; none is refused."""
    scene = replace(fakes.scene(), lights=(DirectionalLight(direction=(0.0, 0.0, 1.0)),))
    line = light_line(scene)
    assert np.isfinite(line.along).all()
    assert line.light_deg == pytest.approx(0.0, abs=1e-6)


def test_binned_samples_scatter_about_the_truth_by_their_noise(report: MaterialReport) -> None:
    """Chi-square over the bins is that of their count, within five sds: values, weights and positions are right."""
    fits = (report.fits[0],)
    scene = replace(report.scene, lights=report.fits[0].scene.lights)
    truth = replace(report, scene=scene)
    for channel in range(3):
        bins = binned(truth, fits, channel, edges_deg=np.linspace(-50, 85, 91))
        z = (bins.value - bins.fits[0]) / bins.sd
        assert len(z) > 80
        assert float(z @ z) == pytest.approx(len(z), abs=5 * np.sqrt(2 * len(z)))


def test_a_wrong_fit_does_not_pass_that_test(report: MaterialReport) -> None:
    """The control: a lobe half a percent brighter is far from the same samples."""
    fit = report.fits[0]
    wrong = replace(fit, colours={**fit.colours, "diffuse_albedo": 1.005 * fit.colours["diffuse_albedo"]})
    bins = binned(report, (wrong,), 1, edges_deg=np.linspace(-50, 85, 91))
    z = (bins.value - bins.fits[0]) / bins.sd
    assert float(z @ z) > len(z) + 5 * np.sqrt(2 * len(z))


def test_clipped_samples_are_left_out_of_the_bins(report: MaterialReport) -> None:
    """A flagged sample changes no mean, whatever it holds."""
    planes = tuple(
        replace(
            plane,
            values=np.where(plane.values > 0.3, np.float32(9.0), plane.values),
            flags=(plane.values > 0.3).astype(np.uint8),
        )
        for plane in report.image.planes
    )
    spoilt = replace(report, image=replace(report.image, planes=planes))
    bins = binned(spoilt, (report.fits[0],), 1, edges_deg=np.linspace(-50, 85, 91))
    assert bins.value.max() < 0.31


def test_fits_are_averaged_at_the_samples_own_places(report: MaterialReport) -> None:
    """A coarse bin over a sharp highlight shows no misfit of its own."""
    fit = report.fits[0]
    coarse = binned(report, (fit,), 1, edges_deg=np.linspace(0, 40, 5))
    line = light_line(fit.scene)
    x, y = positions(fit.scene, line, np.sin(np.radians(coarse.angle_deg)))
    middle = predict(fit, x, y).model[:, 1]
    assert np.abs((coarse.value - coarse.fits[0]) / coarse.sd).max() < 5
    assert np.abs((coarse.value - middle) / coarse.sd).max() > 20  # what the middle of each bin would have shown


@pytest.mark.parametrize("factor", [1, 2, 3])
def test_block_means_are_of_what_is_finite(factor: int) -> None:
    """Each block's mean of its finite values, NaN where there are none, as the plainest code gives it."""
    values = np.random.default_rng(0).normal(size=(13, 11, 3))
    values[2:9, 3:8] = np.nan
    values[0, 0, 1] = np.inf
    got = shrunk(values, factor)
    assert got.shape == (13 // factor, 11 // factor, 3)
    for row, column, channel in np.ndindex(*got.shape):
        block = values[row * factor : (row + 1) * factor, column * factor : (column + 1) * factor, channel]
        kept = block[np.isfinite(block)]
        expected = kept.mean() if len(kept) else np.nan
        np.testing.assert_allclose(got[row, column, channel], expected, rtol=1e-12)


def test_small_layers_fit_the_page(layers: ModelLayers) -> None:
    """At most 400 pixels, whatever came in; residuals only of samples that took part."""
    large = replace(
        layers,
        **{
            name: np.repeat(np.repeat(getattr(layers, name), 6, 0), 6, 1)
            for name in ("photograph", "diffuse", "specular", "used")
        },
    )
    shown = small(large)
    assert max(shown.model.shape) <= 400
    assert shown.factor == 3
    unused = small(replace(layers, used=np.zeros_like(layers.used)))
    assert not np.isfinite(unused.residual).any()


def test_a_mosaics_residuals_are_noise(report: MaterialReport, layers: ModelLayers) -> None:
    """Over their own noise they have unit variance off the limb and no part along the slope of the model."""
    shown = small(layers)
    z = shown.residual / sample_sd(report, shown.model)
    slopes = np.array(np.gradient(shown.model, axis=(0, 1)))
    core = np.isfinite(z).all(axis=-1) & np.isfinite(slopes).all(axis=(0, -1)) & (shown.diffuse[..., 1] > 0.1)
    assert np.mean(z[core] ** 2, axis=0) == pytest.approx(np.ones(3), abs=5 * np.sqrt(2 / core.sum()))
    for slope in slopes:
        for along, left in zip(slope[core].T, z[core].T, strict=True):
            assert abs(np.corrcoef(along, left)[0, 1]) < 5 / np.sqrt(core.sum())


def test_one_tone_curve_serves_all_pictures(report: MaterialReport, layers: ModelLayers) -> None:
    """It grows with radiance, never clips, shows the light's colour as grey, and the body well exposed."""
    tone = tone_of(report, small(layers).diffuse)
    ramp = np.linspace(0.0, 3.0, 50)[:, None] * light_of(report)
    shown = tone.show(ramp)
    assert np.ptp(shown, axis=-1).max() < 0.01
    assert (np.diff(shown[:, 1]) > 0).all()
    assert shown.max() <= 1.0
    body = tone.show(layers.diffuse[np.isfinite(layers.diffuse).all(axis=-1)])
    assert 0.6 < body.max() < 0.95
    assert len(pictures(report, small(layers), tone)) == 6


def test_the_lights_colour_is_taken_from_the_best_that_is_known(report: MaterialReport) -> None:
    """Irradiance, else the separation, else the camera's white balance, else none."""
    np.testing.assert_allclose(light_of(report), fakes.IRRADIANCE / fakes.IRRADIANCE.max())
    scene = replace(report.scene, lights=(DirectionalLight(direction=(0.0, 0.0, 1.0)),))
    without = replace(report, scene=scene)
    assert report.separation is not None
    expected = report.separation.light_colour / report.separation.light_colour.max()
    np.testing.assert_allclose(light_of(without), expected)
    np.testing.assert_allclose(light_of(replace(without, separation=None)), [0.55, 1.0, 0.7])
    image = replace(report.image, metadata=replace(fakes.METADATA, as_shot_neutral=(0.0, 1.0, np.nan)))
    np.testing.assert_array_equal(light_of(replace(without, separation=None, image=image)), np.ones(3))


def test_a_highlight_beyond_the_white_level_is_called_so(report: MaterialReport) -> None:
    """The figures say where samples clip; below the white level they say nothing of it."""
    dim = replace(report, image=replace(report.image, white=0.5))
    for draw in (whole_ball, lambda one: highlight(one, (0, 1, 2, 3, 4))):
        assert "samples clip at 0.5; the fit peaks at 0.89" in draw(dim)
        assert "samples clip" not in draw(report)


def test_a_ball_without_a_usable_sample_still_has_its_figures(report: MaterialReport) -> None:
    """All flagged: curves without points, and no warning."""
    planes = tuple(replace(plane, flags=np.full_like(plane.flags, 1)) for plane in report.image.planes)
    blind = replace(report, image=replace(report.image, planes=planes))
    assert whole_ball(blind).startswith("<svg")
    assert highlight(blind, (0, 1)).startswith("<svg")


def test_a_grey_body_still_has_a_figure_of_its_cluster(report: MaterialReport, layers: ModelLayers) -> None:
    """Where body and light have one colour there is no plane; the figure is drawn all the same."""
    assert report.separation is not None
    nan = np.full(3, np.nan)
    grey = replace(
        report.separation, light_colour=report.separation.body_colour, angle_deg=0.0, corner=nan, highlight_colour=nan
    )
    assert skewed_t(grey, layers, tone_of(report, layers.diffuse)).startswith("<svg")


def test_a_posterior_that_does_not_vary_has_no_corner_plot(report: MaterialReport) -> None:
    """Constant or missing draws are no reason to fail."""
    fixed = {name: np.zeros_like(draws) for name, draws in report.fits[0].draws.items()}
    assert corner_plot(replace(report.fits[0], draws=fixed)) is None
    assert corner_plot(replace(report.fits[0], draws={})) is None
    one = replace(report.fits[0], draws={"roughness_rad": report.fits[0].draws["roughness_rad"]})
    assert (corner_plot(one) or "").startswith("<svg")
