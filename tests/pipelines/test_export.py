"""The material for renderers: each format by an independent reader, and what is lost is said."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from pipelines.export import EXPORTERS, Exporter, exporter, material_of, register
from pipelines.export.colour import srgb_hex
from pipelines.export.conductor import complex_index, reflectance
from pipelines.export.equivalent import equivalents
from pipelines.export.material import Material
from tests.pipelines import fakes
from toolkit.errors import UsageError
from toolkit.inference.layers import predict
from toolkit.records import Estimate, Fit, MaterialReport
from toolkit.reflectance import LOBES


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report()


@pytest.fixture(scope="module")
def camera_material(report: MaterialReport) -> Material:
    """The Beckmann fit's material in camera RGB: no colour matrix in the file."""
    return material_of(replace(report, colour=None, best=3))


def metal(report: MaterialReport) -> MaterialReport:
    """Gold: no body, a coloured F0."""
    gold = np.array([0.95, 0.7, 0.35])

    def is_now(parameter: Estimate) -> Estimate:
        value = {"diffuse_albedo": np.zeros(3), "specular_strength": gold, "specular_f0": gold}.get(parameter.name)
        return parameter if value is None else replace(parameter, estimate=value)

    fit = replace(report.fits[4], parameters=tuple(map(is_now, report.fits[4].parameters)))
    return replace(report, colour=None, fits=(fit,), best=0)


def mitsuba_value(text: str, light: tuple[float, float, float]) -> np.ndarray:
    """BRDF times cosine of the exported BSDF, seen from straight above."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    bsdf = mi.load_string(text)
    at = mi.SurfaceInteraction3f()
    at.wi, at.p, at.n, at.t = mi.Vector3f(0, 0, 1), [0, 0, 0], [0, 0, 1], 0.0
    at.sh_frame = mi.Frame3f([0, 0, 1])
    return np.array(bsdf.eval(mi.BSDFContext(), at, mi.Vector3f(*light)))


@pytest.mark.parametrize("angle_deg", [0.0, 10.0, 25.0, 60.0])
def test_mitsuba_reflects_what_was_fitted(report: MaterialReport, camera_material: Material, angle_deg: float) -> None:
    """BRDF times cosine, against the fit's own lobes: exact for Beckmann over Lambert but for Schlick's Fresnel."""
    fit, angle = report.fits[3], math.radians(angle_deg)
    light = (math.sin(angle), 0.0, math.cos(angle))
    there = predict(
        replace(fit, scene=replace(fit.scene, lights=(fakes.LIGHT.model_copy(update={"direction": light}),))),
        np.array([fit.scene.sphere.centre_px[0]]),
        np.array([fit.scene.sphere.centre_px[1]]),
    )
    expected = ((there.diffuse + there.specular) / fakes.IRRADIANCE)[0]
    got = mitsuba_value(EXPORTERS["mitsuba"].text(camera_material), light)
    np.testing.assert_allclose(got, expected, rtol=2e-3)


def test_mitsuba_loads_in_spectral_variants_too(camera_material: Material) -> None:
    """A neutral highlight is written as single numbers, which all variants read; rgb indices would come out black."""
    text = EXPORTERS["mitsuba"].text(camera_material)
    assert '<rgb name="eta"' not in text
    assert "for all of Mitsuba's variants" in text


def test_a_metal_is_a_conductor_of_its_own_colour(report: MaterialReport) -> None:
    """At normal incidence it reflects D / 4 times F0."""
    material = material_of(metal(report))
    assert material.metal
    alpha = report.fits[4].shape["alpha"]
    got = mitsuba_value(EXPORTERS["mitsuba"].text(material), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(got, np.array([0.95, 0.7, 0.35]) / (4 * math.pi * alpha**2), rtol=1e-4)
    gltf = json.loads(EXPORTERS["gltf"].text(material))["materials"][0]
    assert gltf["pbrMetallicRoughness"]["metallicFactor"] == 1.0
    assert gltf["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx([0.95, 0.7, 0.35])
    assert '"conductor"' in EXPORTERS["pbrt"].text(material)
    assert 'name="metalness" type="float" value="1"' in EXPORTERS["materialx"].text(material)


def test_materialx_is_a_standard_surface(camera_material: Material) -> None:
    """Well-formed XML whose inputs carry colour, roughness and index; nothing is called linear sRGB that is not."""
    root = ET.fromstring(EXPORTERS["materialx"].text(camera_material))  # noqa: S314  # our own text
    inputs = {one.get("name"): one for one in root.find("standard_surface")}  # type: ignore[union-attr]
    colour = [float(v) for v in (inputs["base_color"].get("value") or "").split(",")]
    np.testing.assert_allclose(colour, fakes.ALBEDO, rtol=1e-3)
    assert float(inputs["specular_roughness"].get("value") or 0) ** 2 == pytest.approx(camera_material.ggx.alpha)
    assert float(inputs["specular_IOR"].get("value") or 0) == pytest.approx(1.5, abs=0.01)
    assert inputs["base_color"].get("colorspace") is None
    nodes = {one.get("name") for one in root}
    assert root.find("surfacematerial/input").get("nodename") in nodes  # type: ignore[union-attr]


def test_gltf_is_an_asset_with_one_material(camera_material: Material) -> None:
    """Version 2.0; the extensions used are declared; factors lie within what the specification allows."""
    asset = json.loads(EXPORTERS["gltf"].text(camera_material))
    assert asset["asset"]["version"] == "2.0"
    (material,) = asset["materials"]
    assert set(material["extensions"]) == set(asset["extensionsUsed"])
    rough = material["pbrMetallicRoughness"]
    assert all(0.0 <= v <= 1.0 for v in [*rough["baseColorFactor"], rough["metallicFactor"], rough["roughnessFactor"]])
    ior = material["extensions"]["KHR_materials_ior"]["ior"]
    f0 = ((ior - 1) / (ior + 1)) ** 2
    colour = material["extensions"]["KHR_materials_specular"]["specularColorFactor"]
    np.testing.assert_allclose(f0 * np.array(colour), camera_material.f0, rtol=1e-6)
    assert material["extras"]["colourSpace"] == "camera RGB"


def test_pbrt_is_one_statement_of_paired_parameters(camera_material: Material) -> None:
    """Every typed name is followed by its value; alpha is not remapped; the rest is comment."""
    lines = EXPORTERS["pbrt"].text(camera_material).splitlines()
    (statement,) = [line for line in lines if not line.startswith("#")]
    assert re.fullmatch(
        r'MakeNamedMaterial "ball"( "(string|rgb|float|bool) \w+" ("[\w]+"|\[[^\]"]*\]|false))+', statement
    )
    assert f'"float roughness" [ {camera_material.ggx.alpha:.9g} ] "bool remaproughness" false' in statement


@pytest.mark.parametrize("name", list(EXPORTERS))
def test_what_is_lost_is_said_in_the_file(report: MaterialReport, name: str) -> None:
    """Another lobe, another masking, the colour space, an unknown scale: each in words."""
    relative = replace(report, scene=replace(report.scene, scale="relative"))
    text = EXPORTERS[name].text(material_of(relative))
    assert "torrance-sparrow (roughness_rad 0.12)" in text
    assert "Smith masking" in text
    assert "the scale is unknown" in text
    assert "linear sRGB" in text


@pytest.mark.parametrize("name", list(EXPORTERS))
def test_hostile_names_break_no_format(name: str) -> None:
    """Quotes, angle brackets, comment ends and control characters stay out of every file."""
    bad = fakes.hostile_report()
    text = EXPORTERS[name].text(material_of(replace(bad, image=replace(bad.image, sha256=fakes.HOSTILE))))
    assert "script>" not in text
    assert "cmd()|" not in text
    assert all(c.isprintable() or c == "\n" for c in text)
    if name in ("mitsuba", "materialx"):
        ET.fromstring(text)  # noqa: S314  # our own text
    if name == "gltf":
        json.loads(text)


@pytest.mark.parametrize("name", list(EXPORTERS))
def test_the_same_report_gives_the_same_file(report: MaterialReport, name: str) -> None:
    """No clock, no order of a set."""
    assert EXPORTERS[name].text(material_of(report)) == EXPORTERS[name].text(material_of(fakes.report()))


def test_exporters_are_found_by_name_and_only_once() -> None:
    """An unknown name is the caller's mistake, a second exporter of a name or suffix the programmer's."""
    assert exporter("gltf").suffix == ".gltf"
    with pytest.raises(UsageError, match="gltf, materialx, mitsuba, pbrt"):
        exporter("blender")
    with pytest.raises(ValueError, match="exists already"):
        register(Exporter(name="other", title="", suffix=".gltf", text=lambda _: ""))
    assert "other" not in EXPORTERS


def test_colours_as_hex() -> None:
    """The sRGB curve at its ends and in the middle; NaN is black."""
    assert (
        srgb_hex(np.array([0.0, 0.2140411, 1.0])) == "#007fff" or srgb_hex(np.array([0.0, 0.2140411, 1.0])) == "#0080ff"
    )
    assert srgb_hex(np.array([np.nan, -1.0, 7.0])) == "#0000ff"


@pytest.mark.parametrize("shininess", [50.0, 250.0, 2000.0])
def test_blinns_exponent_is_beckmanns_alpha_by_the_known_rule(shininess: float) -> None:
    """alpha^2 = 2 / (n + 2) for sharp lobes (Walter et al. 2007); Phong's exponent is a quarter of Blinn's."""
    blinn = equivalents("blinn-phong", {"shininess": shininess}, {}, half_angle_rad=0.01)["beckmann"]
    assert blinn.alpha == pytest.approx(math.sqrt(2 / (shininess + 2)), rel=0.03)
    phong = equivalents("phong", {"shininess": shininess / 4}, {}, half_angle_rad=0.01)["beckmann"]
    assert phong.alpha == pytest.approx(blinn.alpha, rel=0.03)


@pytest.mark.parametrize(("alpha", "ratio"), [(0.1, 1.003), (0.2, 1.013), (0.3, 1.027)])
def test_the_gaussian_lobe_nearest_to_beckmann_is_the_published_one(alpha: float, ratio: float) -> None:
    """Sigma sqrt(2) / alpha, worked out elsewhere; masking and this highlight's edge move it by under 1.5 %."""
    found = equivalents("torrance-sparrow", {"roughness_rad": ratio * alpha / math.sqrt(2)}, {}, half_angle_rad=0.01)
    assert found["beckmann"].alpha == pytest.approx(alpha, rel=0.015)


@pytest.mark.parametrize("name", ["beckmann", "ggx"])
def test_a_renderers_own_lobe_is_its_own_equivalent(name: str) -> None:
    """Same alpha, amplitude one, nothing missed."""
    found = equivalents(name, {"alpha": 0.23}, {"masking": "smith"}, half_angle_rad=0.3)[name]
    assert found.alpha == pytest.approx(0.23, rel=1e-4)
    assert found.gain == pytest.approx(1.0, rel=1e-3)
    assert found.misfit < 1e-3


@pytest.mark.parametrize("f0", [0.02, 0.04, 0.17, 0.3, 0.6, 0.82, 0.95])
def test_a_complex_index_reflects_its_f0_and_follows_schlick(f0: float) -> None:
    """Exact head on; a dielectric below 0.2; within 0.07 of Schlick's curve up to 80 degrees."""
    eta, k = (float(value[0]) for value in complex_index(np.full(3, f0)))
    cosine = np.cos(np.radians([0.0, 20.0, 40.0, 60.0, 80.0]))
    got = reflectance(cosine, np.array(eta), np.array(k))
    assert got[0] == pytest.approx(f0, rel=1e-9)
    assert (k == 0.0) == (f0 < 0.2)
    np.testing.assert_allclose(got, f0 + (1 - f0) * (1 - cosine) ** 5, atol=0.07)


def test_phongs_peak_becomes_a_reflectance(report: MaterialReport) -> None:
    """A lobe that is no microfacet one is matched in height as well: the equivalent peaks where it peaks."""
    fit: Fit = report.fits[1]
    material = material_of(replace(report, best=1))
    assert 0.01 < material.f0.mean() < 0.2
    gain = material.nearest.gain
    assert gain == material.beckmann.gain
    assert gain != 1.0
    assert fit.model in "".join(material.notes)


SPECULAR = [lobe.name for lobe in LOBES.values() if lobe.kind == "specular"]


@pytest.mark.parametrize("model", SPECULAR)
def test_every_registered_lobe_has_an_equivalent_and_every_format_takes_it(report: MaterialReport, model: str) -> None:
    """A new lobe is exported by its registration alone: a width within the box, finite colours, all files."""
    lobe = LOBES[model]
    fit = replace(
        report.fits[0 if lobe.fresnel else 1],
        model=model,
        variant=lobe.complete({}),
        shape={p.name: p.starts[len(p.starts) // 2] for p in lobe.parameters},
    )
    material = material_of(replace(report, fits=(fit,), best=0))
    assert 1e-3 <= material.nearest.alpha <= 1.0
    assert np.isfinite(material.f0).all()
    for one in EXPORTERS.values():
        assert "nan" not in one.text(material)
