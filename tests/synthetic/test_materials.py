"""Materials: what they accept, and where the named ones' numbers come from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from synthetic.materials import material
from synthetic.named import MATERIALS
from tests.realdata import folder
from toolkit.errors import BadInputError

GOOD = {"roughness_rad": 0.1, "diffuse_albedo": 0.5, "specular_f0": 0.04}


def test_one_number_stands_for_three_channels() -> None:
    """A colour is a number or three of them; arrays are the record's own and read-only."""
    made = material("torrance-sparrow", GOOD | {"diffuse_albedo": (0.1, 0.2, 0.3)}, diffuse="lambert")
    np.testing.assert_array_equal(made.colours["specular_f0"], [0.04] * 3)
    np.testing.assert_array_equal(made.colours["diffuse_albedo"], [0.1, 0.2, 0.3])
    assert made.shape == {"roughness_rad": 0.1}
    assert not made.colours["specular_f0"].flags.writeable


@pytest.mark.parametrize(
    ("model", "changed", "found"),
    [
        ("chrome", {}, "'chrome' is no specular model; expected one of"),
        ("lambert", {}, "'lambert' is no specular model"),
        ("torrance-sparrow", {"roughness_rad": None}, "shape numbers none; expected roughness_rad"),
        ("torrance-sparrow", {"shininess": 5.0}, "shape numbers roughness_rad, shininess; expected roughness_rad"),
        ("torrance-sparrow", {"roughness_rad": (0.1, 0.1, 0.1)}, "roughness_rad is .* expected one number"),
        ("torrance-sparrow", {"roughness_rad": 0.0}, "roughness_rad is 0.0; expected 0.005 to"),
        ("torrance-sparrow", {"roughness_rad": float("nan")}, "roughness_rad is nan"),
        ("torrance-sparrow", {"diffuse_albedo": None}, "expected diffuse_albedo and specular_f0 or"),
        ("torrance-sparrow", {"specular_strength": 0.1}, "colours .*expected"),
        ("torrance-sparrow", {"diffuse_albedo": (0.1, 0.2)}, "expected one number, or three"),
        ("torrance-sparrow", {"diffuse_albedo": -0.1}, "diffuse_albedo is .*expected 0 or more"),
        ("torrance-sparrow", {"specular_f0": None, "specular_index": 0.9}, "specular_index is .*expected 1 or more"),
        ("phong", {"roughness_rad": None, "shininess": 9.0}, "expected diffuse_albedo and specular_albedo"),
    ],
)
def test_what_does_not_fit_the_lobes_is_refused_in_one_line(model: str, changed: dict, found: str) -> None:
    """The error says what was found and what was expected."""
    numbers = {key: value for key, value in (GOOD | changed).items() if value is not None}
    with pytest.raises(BadInputError, match=found) as caught:
        material(model, numbers)
    assert "\n" not in str(caught.value)


def test_an_unknown_variant_is_refused() -> None:
    """The choices are the lobe's own."""
    with pytest.raises(BadInputError, match="masking"):
        material("torrance-sparrow", GOOD, variant={"masking": "none"})


def test_a_dozen_materials_each_say_what_they_rest_on() -> None:
    """Every named material has a source, and reflects no more than it gets."""
    assert len(MATERIALS) >= 12
    for name, made in MATERIALS.items():
        assert made.source, name
        body, gloss = (np.max(c) for c in (made.colours["diffuse_albedo"], list(made.colours.values())[-1]))
        assert body <= 1.0 and (gloss <= 1.0 or "specular_index" in made.colours), name  # noqa: PT018  # one statement


def test_the_measured_bodies_follow_the_published_fits() -> None:
    """Albedo is pi x kD and the highlight falls to half where the ABC lobe does (Low et al. 2012)."""
    published = json.loads((folder("merl_fits") / "abc_params.json").read_text())
    measured = {name: made for name, made in MATERIALS.items() if made.source == "MERL"}
    assert len(measured) >= 6
    for name, made in measured.items():
        fit = published[name]
        half_angle = np.arccos(1.0 - (2.0 ** (1.0 / fit["C"]) - 1.0) / fit["B"])
        assert made.shape["roughness_rad"] == pytest.approx(half_angle / np.sqrt(2 * np.log(2)), rel=0.01), name
        np.testing.assert_allclose(made.colours["diffuse_albedo"], np.pi * np.array(fit["kD"]), atol=1e-3)
