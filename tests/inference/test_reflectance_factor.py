"""The reflectance factor is one quantity whichever body lobe tells of it."""

from __future__ import annotations

import numpy as np
import pytest

from synthetic.camera import exposure_for
from synthetic.materials import material
from synthetic.render import render
from synthetic.scenes import exposed
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.records import Fit
from toolkit.reflectance import LOBES
from toolkit.reflectance.factor import reflectance_factor

from .ball import BODY, F0, photograph, scene_of

THROUGH_45_DEG, THROUGH_0_DEG = 1.0 - 0.0502, 1.0 - 0.04  # of unpolarised light, index 1.5 (Hecht, Optics, fig. 4.49)


def test_of_lambert_it_is_the_albedo_and_of_wolff_what_the_surface_lets_through_twice() -> None:
    """By the tabled reflectance of glass."""
    assert reflectance_factor(LOBES["lambert"], ()) == pytest.approx(1.0, abs=1e-12)
    indices = np.array([1.5, 1.3])
    assert reflectance_factor(LOBES["wolff"], (indices,))[0] == pytest.approx(THROUGH_45_DEG * THROUGH_0_DEG, abs=1e-4)


def test_lambert_and_wolff_are_nearer_in_it_than_in_their_albedos() -> None:
    """Wolff made the photograph: his factor is true; Lambert, who is wrong, is off by half as much as in his albedo."""
    scene = scene_of(240, light_deg=45.0)
    numbers = {"roughness_rad": 0.12, "diffuse_index": 1.5, "diffuse_albedo": BODY, "specular_f0": F0}
    picture = render(
        scene, material("torrance-sparrow", numbers, diffuse="wolff"), width_px=240, height_px=240, supersample=4
    )
    exposure = exposure_for(picture, highlight=0.8)
    image, seen = photograph(picture.radiance() * exposure, seed=2), exposed(scene, exposure)
    cells = gather_for(image, seen)
    fits = [infer(image, seen, cells, Model.named("torrance-sparrow", body), seed=1) for body in ("lambert", "wolff")]
    albedo, factor = ([_told(fit, name) for fit in fits] for name in ("diffuse_albedo", "reflectance_factor"))
    assert factor[1] == pytest.approx(np.array(BODY) * THROUGH_45_DEG * THROUGH_0_DEG, rel=2e-3)
    assert np.all(np.abs(factor[0] / factor[1] - 1) < 0.6 * np.abs(albedo[0] / albedo[1] - 1))


def _told(fit: Fit, name: str) -> np.ndarray:
    return np.asarray(next(e.estimate for e in fit.parameters if e.name == name))
