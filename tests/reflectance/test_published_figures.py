"""Figures that others computed or measured."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import direction, seen
from toolkit.reflectance import LOBES


@pytest.mark.parametrize(
    ("sigma", "light_deg", "peak_deg"),
    [
        (0.05, 30, 30.3),
        (0.05, 45, 45.6),
        (0.05, 60, 61.0),
        (0.1, 30, 31.4),
        (0.1, 45, 47.5),
        (0.1, 60, 64.9),
        (0.2, 30, 36.9),
        (0.2, 45, 75.0),
        (0.2, 60, 80.0),
    ],
)
def test_off_specular_peak(sigma, light_deg, peak_deg):
    """The Torrance-Sparrow peak lies beyond the mirror direction, within 0.2 degrees of the independent figures."""
    view_deg = np.arange(0.0, 90.0, 0.01)
    cosines = seen(direction(np.radians(light_deg), 0.0), direction(np.radians(view_deg), np.pi))
    value = LOBES["torrance-sparrow"].value(cosines, (sigma,))
    assert view_deg[np.argmax(value)] == pytest.approx(peak_deg, abs=0.2)


def test_the_lectures_closing_form():
    """K exp(-theta_h^2 / (2 sigma^2)) G / (n.v) with K = 1 / (8 pi sigma^2), for small sigma."""
    sigma = 0.02
    light = direction(0.6, 0.0)
    cosines = seen(light, direction(0.6 + np.linspace(-0.05, 0.05, 21), np.pi))
    theta_h = np.arcsin(np.sqrt(cosines.sin2_h))
    closing = np.exp(-(theta_h**2) / (2 * sigma**2)) / (8 * np.pi * sigma**2 * cosines.n_dot_v)
    np.testing.assert_allclose(LOBES["torrance-sparrow"].value(cosines, (sigma,)), closing, rtol=2 * sigma**2)


def test_albedos_beyond_1_are_where_the_literature_has_them():
    """Oren-Nayar reaches about 1.015, Ward with Duer's normaliser about 1.33: neither claims to conserve energy."""
    from tests.laws.furnace import albedo

    grazing = np.radians([0, 30, 60, 80, 85, 88, 89])
    oren = max(albedo(LOBES["oren-nayar"], (s,), {}, v) for s in (0.1, 0.2, 0.3, 0.5, 0.8) for v in grazing)
    assert 1.0 + 1e-3 < oren < 1.03
    duer = max(albedo(LOBES["ward"], (a,), {"normalisation": "duer"}, v) for a in (0.1, 0.2, 0.3, 0.5) for v in grazing)
    assert duer > 1.25


@pytest.mark.parametrize("name", ["torrance-sparrow", "beckmann", "ggx", "gtr"])
def test_v_grooves_grow_with_light_and_view_grazing_together(name):
    """There the lobe grows as 1 / cos: bounded is claimed for a fixed light only."""
    grazing = np.pi / 2 - np.array([1e-2, 1e-3, 1e-4])
    shape = (0.2, 2.0)[: len(LOBES[name].parameters)]
    cosines = seen(direction(grazing, 0.0), direction(grazing, np.pi))
    value = LOBES[name].value(cosines, shape, {"masking": "v-groove"})
    np.testing.assert_allclose(value[1:] / value[:-1], 10.0, rtol=1e-2)
