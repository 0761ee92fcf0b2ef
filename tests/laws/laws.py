"""What must hold of every lobe, and of those that claim more; each law raises AssertionError where it does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance import Claim, Cosines, Lobe

from .furnace import albedo
from .space import UP, around, cases, direction, extremes, seen, shapes, variants

Law = Callable[[Lobe], None]


def describes_itself(lobe: Lobe) -> None:
    """Bounds in order, starts between them, a name for everything."""
    assert lobe.name
    assert lobe.title
    assert lobe.formula
    assert lobe.source
    for parameter in lobe.parameters:
        assert parameter.low < parameter.high, parameter.name
        assert not parameter.log or parameter.low > 0.0, parameter.name
        assert parameter.starts, parameter.name
        assert all(parameter.low <= start <= parameter.high for start in parameter.starts), parameter.name
        assert parameter.unit, parameter.name
        assert parameter.typical, parameter.name
        assert parameter.meaning, parameter.name
    assert len({p.name for p in lobe.parameters}) == len(lobe.parameters)
    for option, choice in lobe.variant_claims:
        assert choice in lobe.variants[option]


def finite_and_not_negative(lobe: Lobe) -> None:
    """Finite, not negative, float64, at every pair of directions, the horizon and below it included."""
    for light, view in (around(300), extremes()):
        for radius in (0.0, 0.02):
            cosines = seen(light, view, radius)
            for variant, shape in cases(lobe):
                value = lobe.value(cosines, shape, variant)
                assert value.shape == cosines.n_dot_l.shape, (variant, shape)
                assert value.dtype == np.float64, (variant, shape)
                assert np.all(np.isfinite(value)), (variant, shape)
                assert np.all(value >= 0.0), (variant, shape)
                for slope in lobe.with_derivatives(cosines, shape, variant):
                    assert np.all(np.isfinite(slope)), (variant, shape)


def dark_beyond_the_horizon(lobe: Lobe) -> None:
    """0 where the light or the camera is at or below the horizon."""
    light, view = extremes()
    cosines = seen(light, view)
    dark = (cosines.n_dot_l <= 0.0) | (cosines.n_dot_v <= 0.0)
    for variant, shape in cases(lobe):
        assert np.all(lobe.value(cosines, shape, variant)[dark] == 0.0), (variant, shape)


def bounded_at_grazing_view(lobe: Lobe) -> None:
    """Under a fixed light no growth as the view comes down to the horizon, where claimed."""
    elevation = 10.0 ** -np.arange(3.0, 13.0)
    for light_rad in (0.2, 0.8, 1.3, 1.5):
        for azimuth_rad in (0.0, 2.0, np.pi):
            cosines = seen(direction(light_rad, 0.0), direction(np.pi / 2 - elevation, azimuth_rad))
            for variant, shape in cases(lobe):
                if Claim.BOUNDED_AT_GRAZING_VIEW in lobe.claims_of(variant):
                    value = lobe.value(cosines, shape, variant)
                    assert value.max() <= 10.0 * value[0] + 1e-100, (variant, shape, light_rad)


def reciprocal(lobe: Lobe) -> None:
    """Lobe over n.l is the same with light and view exchanged, where claimed."""
    light, view = around(300)
    there, back = seen(light, view), seen(view, light)
    for variant, shape in cases(lobe):
        if Claim.RECIPROCAL in lobe.claims_of(variant):
            one = lobe.value(there, shape, variant) * there.n_dot_v
            other = lobe.value(back, shape, variant) * there.n_dot_l
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-280, err_msg=f"{variant} {shape}")


def conserves_energy(lobe: Lobe) -> None:
    """In a white furnace no brighter than 1 + 1e-3, where claimed."""
    for variant, shape in cases(lobe):
        if Claim.CONSERVES_ENERGY in lobe.claims_of(variant):
            for view_rad in (0.0, 0.8, 1.25, 1.5, 1.56):
                assert albedo(lobe, shape, variant, view_rad) <= 1.0 + 1e-3, (variant, shape, view_rad)


def the_same_turned(lobe: Lobe) -> None:
    """The same when surface, light and camera turn together, or are mirrored."""
    light, view = around(100)
    rng = np.random.default_rng(4)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    normal = turn @ UP
    for variant, shape in cases(lobe):
        as_is = lobe.value(seen(light, view), shape, variant)
        turned = lobe.value(Cosines.of(normal, light @ turn.T, view @ turn.T), shape, variant)
        # the sharpest lobes magnify the rounding of the cosines themselves
        np.testing.assert_allclose(turned, as_is, rtol=1e-6, atol=1e-9 * as_is.max(), err_msg=f"{variant} {shape}")


def broadcasts(lobe: Lobe) -> None:
    """Arrays of shape numbers against arrays of directions give what one call each gives."""
    light, view = (v[:6].reshape(2, 3, 3) for v in around(6))
    cosines = seen(light, view)
    points = shapes(lobe, (0.2, 0.7))
    columns = tuple(np.array(column)[:, None, None] for column in zip(*points, strict=True))
    for variant in variants(lobe):
        together = np.broadcast_to(lobe.value(cosines, columns, variant), (len(points), 2, 3))
        slopes = lobe.with_derivatives(cosines, columns, variant)
        for number, shape in enumerate(points):
            np.testing.assert_allclose(together[number], lobe.value(cosines, shape, variant), rtol=1e-12)
            for all_at_once, alone in zip(slopes, lobe.with_derivatives(cosines, shape, variant), strict=True):
                np.testing.assert_allclose(np.broadcast_to(all_at_once, together.shape)[number], alone, rtol=1e-9)


def gradient_is_the_slope(lobe: Lobe) -> None:
    """The gradient is the value and its slope, by finite differences wherever the lobe is smooth."""
    cosines = seen(*around(400), source_radius_rad=0.02)
    for variant in variants(lobe):
        for shape in shapes(lobe, (0.1, 0.45, 0.9)):
            value, *slopes = lobe.with_derivatives(cosines, shape, variant)
            np.testing.assert_allclose(value, lobe.value(cosines, shape, variant), rtol=1e-9, err_msg=f"{variant}")
            for number, slope in enumerate(slopes):
                _compare(lobe, cosines, shape, variant, number, slope)


def _compare(
    lobe: Lobe, cosines: Cosines, shape: tuple[float, ...], variant: Mapping[str, str], number: int, slope: Floats
) -> None:
    def difference(relative: float) -> Floats:
        step = shape[number] * relative
        up, down = ((*shape[:number], shape[number] + s, *shape[number + 1 :]) for s in (step, -step))
        return (lobe.value(cosines, up, variant) - lobe.value(cosines, down, variant)) / (2.0 * step)

    coarse, fine = difference(4e-6), difference(2e-6)
    largest = np.max(np.abs(slope))
    # a kink within the step (masking that sets in) shows in two differences that disagree
    smooth = np.abs(coarse - fine) <= 1e-6 * largest
    assert np.mean(smooth) > 0.9, (variant, shape, number)
    worst = np.max(np.abs(slope - fine)[smooth])
    assert worst <= 1e-6 * largest, (variant, shape, number, worst / largest)


LAWS: dict[str, Law] = {
    law.__name__: law
    for law in (
        describes_itself,
        finite_and_not_negative,
        dark_beyond_the_horizon,
        bounded_at_grazing_view,
        reciprocal,
        conserves_energy,
        the_same_turned,
        broadcasts,
        gradient_is_the_slope,
    )
}
