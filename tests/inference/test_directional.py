"""Lobes fitted to values at directions: they find their own shape again, and tell real materials apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import around, seen
from tests.realdata import folder
from toolkit.inference.directional import fit_directions
from toolkit.reflectance import LOBES

LIGHT, VIEW = around(400)
NEAR = (LIGHT[:, 2] > 0.25) & (VIEW[:, 2] > 0.25)
COSINES = seen(LIGHT[NEAR], VIEW[NEAR])
SPECULAR = [name for name, lobe in LOBES.items() if lobe.kind == "specular"]


@pytest.mark.parametrize("metric", ["linear", "cube-root"])
@pytest.mark.parametrize("name", SPECULAR)
def test_a_lobe_finds_its_own_shape(name, metric):
    """Exact values of the lobe over Lambert give its shape and colours back."""
    lobe = LOBES[name]
    truth = {
        "shininess": 90.0,
        "roughness_rad": 0.11,
        "alpha": 0.17,
        "tail": 2.4,
        "axis_ratio": 0.97,
        "blur_rad": 0.05,
        "haze": 0.3,
        "spread": 4.0,
    }
    shape = tuple(truth[p.name] for p in lobe.parameters)
    body, gloss = np.array([0.4, 0.2, 0.1]), 0.06
    values = LOBES["lambert"].value(COSINES, ())[:, None] * body + gloss * lobe.value(COSINES, shape)[:, None]
    fit = fit_directions(lobe, LOBES["lambert"], COSINES, values, metric=metric)
    np.testing.assert_allclose(fit.shape, shape, rtol=2e-3)
    np.testing.assert_allclose(fit.colours[0], body, rtol=2e-3)
    assert fit.error < 1e-4


def test_a_body_lobe_has_a_shape_too():
    """The diffuse lobe's numbers follow the specular lobe's."""
    values = (
        LOBES["wolff"].value(COSINES, (1.55,))[:, None] * 0.5 + 0.03 * LOBES["ggx"].value(COSINES, (0.12,))[:, None]
    )
    fit = fit_directions(LOBES["ggx"], LOBES["wolff"], COSINES, values)
    np.testing.assert_allclose(fit.shape, (0.12, 1.55), rtol=2e-3)


def test_colours_are_never_negative():
    """Values that no body explains leave the body black."""
    values = LOBES["ggx"].value(COSINES, (0.2,))[:, None] - 0.02 * COSINES.n_dot_l[:, None]
    fit = fit_directions(LOBES["ggx"], LOBES["lambert"], COSINES, np.maximum(values, 0.0))
    assert np.all(fit.colours >= 0.0)


def test_a_measured_paint_wants_a_highlight():
    """On Cornell's blue acrylic a microfacet lobe leaves less than a third of what Lambert alone leaves."""
    from toolkit.io.brdf_table import read_brdf_table

    table = read_brdf_table(folder("measured_brdf") / "acryl_blue.brdf")
    used = (table.light[:, 2] > 0.25) & (table.view[:, 2] > 0.25)
    cosines = seen(table.light[used], table.view[used])
    values = table.bands()[used] * cosines.n_dot_l[:, None]
    fit = fit_directions(LOBES["beckmann"], LOBES["lambert"], cosines, values, metric="cube-root")
    body = LOBES["lambert"].value(cosines, ())
    alone = np.cbrt(body[:, None] * (body @ values / (body @ body))) - np.cbrt(values)
    assert fit.error < np.sqrt(np.mean(alone**2)) / 3
