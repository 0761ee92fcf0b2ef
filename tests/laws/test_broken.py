"""Each law catches a lobe that breaks it: a law that nothing fails proves nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toolkit.reflectance import LOBES, Claim, Cosines

from .laws import LAWS

LAMBERT, GGX, PHONG, WARD, TS = (LOBES[name] for name in ("lambert", "ggx", "phong", "ward", "torrance-sparrow"))


def _scaled(lobe, factor):
    """The lobe with its value multiplied by a function of the cosines and the shape."""
    return replace(lobe, evaluate=lambda c, *shape, **variant: lobe.evaluate(c, *shape, **variant) * factor(c, *shape))


def _without_limit(cosines, alpha, **_):
    """GGX without any masking: it grows as 1 / (n.v)."""
    from toolkit.reflectance.distributions import ggx

    return ggx(cosines, alpha) / (4.0 * np.maximum(cosines.n_dot_v, 1e-300)) * (cosines.n_dot_v * cosines.n_dot_l > 0)


def _only_floats(cosines, alpha, **variant):
    return GGX.evaluate(cosines, float(np.mean(alpha)), **variant)


BROKEN = {
    "describes_itself": replace(GGX, parameters=(replace(GGX.parameters[0], starts=(7.0,)),)),
    "finite_and_not_negative: negative": _scaled(LAMBERT, lambda c: c.r_dot_v),
    "finite_and_not_negative: infinite": replace(
        LAMBERT, evaluate=lambda c: np.where((c.n_dot_v > 0.0) & (c.n_dot_v < 1e-8), np.inf, LAMBERT.evaluate(c))
    ),
    "finite_and_not_negative: gradient": replace(
        GGX, gradient=lambda c, alpha, **v: (GGX.evaluate(c, alpha, **v), np.where(c.n_dot_h > 0.5, 0.0, np.nan))
    ),
    "dark_beyond_the_horizon": replace(LAMBERT, evaluate=lambda c: c.n_dot_l / np.pi),
    "bounded_at_grazing_view: no masking": replace(GGX, evaluate=_without_limit),
    "bounded_at_grazing_view: ward": replace(WARD, claims=frozenset({Claim.BOUNDED_AT_GRAZING_VIEW})),
    "reciprocal: phong": replace(PHONG, claims=frozenset({Claim.RECIPROCAL}), variant_claims={}),
    "reciprocal: skewed": _scaled(GGX, lambda c, alpha: 1.0 + 1e-6 * c.n_dot_v),
    "conserves_energy: bright": _scaled(LAMBERT, lambda c: 1.002),
    "conserves_energy: duer": replace(WARD, variant_claims={("normalisation", "duer"): {Claim.CONSERVES_ENERGY}}),
    "conserves_energy: sharp": _scaled(TS, lambda c, sigma: np.where(np.asarray(sigma) < 0.006, 1.01, 1.0)),
    "broadcasts": replace(GGX, evaluate=_only_floats),
    "gradient_is_the_slope: value": replace(GGX, gradient=lambda c, alpha, **v: (GGX.evaluate(c, alpha, **v),) * 2),
    "gradient_is_the_slope: another value": replace(
        GGX, gradient=lambda c, alpha, **v: (2.0 * GGX.evaluate(c, alpha, **v), *GGX.gradient(c, alpha, **v)[1:])
    ),
    "gradient_is_the_slope: masking forgotten": replace(
        GGX,
        gradient=lambda c, alpha, **v: (
            GGX.evaluate(c, alpha, **v),
            GGX.gradient(c, alpha, **v)[1] * (1.0 + 1e-4 * c.n_dot_v),
        ),
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_lobe_fails(case):
    """The law named by the case refuses its broken lobe, and accepts none of it in silence."""
    with pytest.raises(AssertionError):
        LAWS[case.split(":")[0]](BROKEN[case])


@pytest.mark.parametrize("name", LOBES)
def test_a_gradient_without_the_value_is_refused(name):
    """Derivatives alone would be taken for the value and all but the last of them; the error names the lobe."""
    lobe = replace(LOBES[name], gradient=lambda *given, **variant: LOBES[name].gradient(*given, **variant)[1:])
    one = Cosines.of(*np.eye(3)[[2, 2, 2]])
    with pytest.raises(TypeError, match=f"gradient of {name} returned"):
        lobe.with_derivatives(one, [parameter.starts[0] for parameter in lobe.parameters])


def test_turning_matters_where_a_lobe_looks_at_the_camera_frame(monkeypatch):
    """A lobe that is not isotropic (cosines taken with a fixed axis) fails the law of rotation."""
    from . import laws

    real = laws.Cosines.of
    monkeypatch.setattr(
        laws.Cosines,
        "of",
        classmethod(
            lambda cls, normal, light, view, **more: replace(
                real(normal, light, view, **more), n_dot_l=np.maximum(light[..., 2], 0.0)
            )
        ),
    )
    with pytest.raises(AssertionError):
        LAWS["the_same_turned"](LAMBERT)


def test_every_law_has_a_broken_lobe():
    """No law goes unproven."""
    assert {case.split(":")[0] for case in BROKEN} | {"the_same_turned"} == set(LAWS)
