"""Microfacet lobes, Lambert and Fresnel's factor against Mitsuba 3, which shares no code with them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import around, seen
from toolkit.reflectance import LOBES, fresnel
from toolkit.reflectance.metals import METALS


@pytest.fixture
def mi():
    """Mitsuba's scalar renderer; whichever variant was set before is set again after."""
    mitsuba = pytest.importorskip("mitsuba", reason="needs mitsuba, a package of the dev group")
    before = mitsuba.variant()
    mitsuba.set_variant("scalar_rgb")
    yield mitsuba
    if before:
        mitsuba.set_variant(before)


def _directions(least=0.02, count=300):
    """Directions as the renderer's single precision knows them, away from the last degree of grazing."""
    light, view = (v.astype(np.float32).astype(float) for v in around(count))
    both = (light[:, 2] > least) & (view[:, 2] > least)
    return light[both], view[both]


def _evaluate(mi, description, light, view, channel=0):
    """The renderer's BSDF times cosine; light and view exchange their roles by reciprocity of their names."""
    bsdf, context = mi.load_dict(description), mi.BSDFContext()
    values = []
    for towards, camera in zip(light, view, strict=True):
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = mi.Vector3f(*camera)
        values.append(bsdf.eval(context, interaction, mi.Vector3f(*towards))[channel])
    return np.array(values)


@pytest.mark.parametrize("alpha", [0.1, 0.25, 0.5, 0.9])
@pytest.mark.parametrize("name", ["beckmann", "ggx"])
def test_rough_mirror(mi, name, alpha):
    """G D / (4 n.v) with Smith's separable masking, to 1e-5 relative where single precision reaches that."""
    light, view = _directions()
    theirs = _evaluate(
        mi, {"type": "roughconductor", "distribution": name, "alpha": alpha, "material": "none"}, light, view
    )
    ours = LOBES[name].value(seen(light, view), (np.float64(np.float32(alpha)),), {"masking": "smith"})
    bright = ours > 1e-6 * ours.max()
    assert bright.sum() > 100
    np.testing.assert_allclose(ours[bright], theirs[bright], rtol=1e-5)
    # the other maskings are other functions: the comparison would notice
    other = LOBES[name].value(seen(light, view), (alpha,), {"masking": "v-groove"})
    assert np.max(np.abs(other - theirs)[bright] / theirs[bright]) > 1e-2


@pytest.mark.parametrize("name", ["beckmann", "ggx"])
def test_rough_metal(mi, name):
    """With gold's n, k at 549 nm: the lobe times the exact conductor's F at theta_d."""
    light, view = _directions()
    n, k = (float(v) for v in METALS["gold"].index(548.6))
    described = {"type": "roughconductor", "distribution": name, "alpha": 0.3}
    described |= {axis: {"type": "rgb", "value": [value] * 3} for axis, value in (("eta", n), ("k", k))}
    theirs = _evaluate(mi, described, light, view)
    cosines = seen(light, view)
    ours = LOBES[name].value(cosines, (0.3,)) * fresnel.conductor(cosines.l_dot_h, n, k)
    bright = ours > 1e-6 * ours.max()
    np.testing.assert_allclose(ours[bright], theirs[bright], rtol=2e-5)


def test_lambert(mi):
    """`diffuse` of reflectance 0.5."""
    light, view = _directions()
    theirs = _evaluate(mi, {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5] * 3}}, light, view)
    np.testing.assert_allclose(0.5 * LOBES["lambert"].value(seen(light, view), ()), theirs, rtol=1e-6)


@pytest.mark.parametrize("index", [1.3, 1.5, 2.4])
def test_fresnel(mi, index):
    """The exact dielectric."""
    cosines = np.linspace(0.01, 1.0, 60)
    theirs = [mi.fresnel(float(c), index)[0] for c in cosines]
    np.testing.assert_allclose(fresnel.dielectric(cosines, index), theirs, rtol=2e-5)


def test_fresnel_of_metals(mi):
    """The exact conductor, at every row of every table."""
    for metal in METALS.values():
        for n, k in zip(metal.n, metal.k, strict=True):
            for cosine in (1.0, 0.7, 0.3, 0.05):
                theirs = mi.fresnel_conductor(cosine, mi.Complex2f(float(n), float(k)))
                ours = fresnel.conductor(np.array(cosine), n, k)
                assert float(ours) == pytest.approx(theirs, rel=2e-5), (metal.name, n, k, cosine)
