"""G: shares of facets, against the integral that defines them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import around, direction, seen
from toolkit.reflectance import masking as g
from toolkit.reflectance.distributions import beckmann, ggx


def _smith(density, theta, alpha):
    """G1 as defined: cos(theta) over the projected area of the facets that face the direction."""
    node, weight = np.polynomial.legendre.leggauss(250)
    m = (np.pi / 4) * (1.0 + node)
    phi = (np.arange(600) + 0.5) * np.pi / 600
    v_dot_m = np.sin(theta) * np.sin(m)[:, None] * np.cos(phi) + np.cos(theta) * np.cos(m)[:, None]
    tilted = direction(m, 0.0)
    facets = density(seen(tilted, tilted), alpha) * np.sin(m) * weight * (np.pi / 4)
    area = np.sum(facets[:, None] * np.maximum(v_dot_m, 0.0)) * (2 * np.pi / 600)
    return np.cos(theta) / area


@pytest.mark.parametrize("theta", [0.7, 1.2, 1.45])
def test_one_sided_ggx_is_smiths(theta):
    """GGX's closed form is the defining integral."""
    assert g.ggx_one_sided(np.cos(theta), 0.5) == pytest.approx(_smith(ggx, theta, 0.5), rel=1e-5)


@pytest.mark.parametrize("theta", [0.7, 1.2, 1.45])
def test_one_sided_beckmann_is_smiths_to_walters_precision(theta):
    """Walter's rational form is within 6e-3 of the defining integral."""
    assert g.beckmann_one_sided(np.cos(theta), 0.5) == pytest.approx(_smith(beckmann, theta, 0.5), abs=6e-3)


@pytest.mark.parametrize("choice", ["v-groove", "smith", "smith-correlated"])
@pytest.mark.parametrize("smith", [g.BECKMANN, g.GGX])
def test_masking_is_a_share(choice, smith):
    """Between 0 and 1, 1 at the normal, the correlated the larger; Walter's rational form overshoots 1 by 6e-5."""
    cosines = seen(*around(500))
    for alpha in (0.01, 0.3, 1.0):
        share = g.masking(cosines, choice, smith, alpha)
        assert np.all((share >= 0.0) & (share <= 1.0 + 1.2e-4))
        assert g.masking(seen(direction(0.0, 0.0), direction(0.0, 0.0)), choice, smith, alpha) == pytest.approx(1.0)
    apart, together = (g.masking(cosines, c, smith, 0.4) for c in ("smith", "smith-correlated"))
    assert np.all(together >= apart * (1.0 - 6e-5))


def test_v_groove_by_hand():
    """The formula of the paper on one pair of directions, where masking has set in."""
    light, view = direction(1.0, 0.0), direction(1.4, np.pi)
    half = (light + view) / np.linalg.norm(light + view)
    expected = min(1.0, 2 * half[2] * view[2] / (half @ view), 2 * half[2] * light[2] / (half @ view))
    assert g.v_groove(seen(light, view)) == pytest.approx(expected, rel=1e-12)
    assert expected < 1.0
