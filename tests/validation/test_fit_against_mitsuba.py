"""Spheres that Mitsuba 3 rendered, fitted by the whole main job: a renderer that shares no code with this project."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from pipelines.fit_material import fit_material
from pipelines.layers import Layer, resolve
from synthetic.files import write_exr
from synthetic.scenes import write_scene_toml

from .mitsuba_render import Ball, render


@pytest.mark.parametrize("alpha", [0.1, 0.25])
@pytest.mark.parametrize("light", ["directional", "point"])
@pytest.mark.parametrize("projection", ["orthographic", "perspective"])
@pytest.mark.parametrize("distribution", ["beckmann", "ggx"])
def test_the_material_comes_back(
    tmp_path: Path,
    distribution: Literal["beckmann", "ggx"],
    projection: Literal["orthographic", "perspective"],
    light: Literal["directional", "point"],
    alpha: float,
) -> None:
    """Alpha, albedo and specular strength within 0.1 % with the matching lobe and Smith masking (1 % is asked)."""
    around = 130.0 + 100.0 * alpha  # no two scenes light the ball from the same side
    ball = Ball(
        distribution=distribution,
        projection=projection,
        light=light,
        alpha=alpha,
        light_around_deg=around,
        light_off_axis_deg=58.0 if alpha > 0.2 else 35.0,
    )
    path = tmp_path / "ball.exr"
    write_exr(path, render(ball, samples=16).astype(np.float32))
    write_scene_toml(Path(f"{path}.toml"), ball.scene, None)
    only = Layer(name="--model", values={"fit": {"models": [f"{distribution}:masking=smith"], "diffuse": ["lambert"]}})
    fit = fit_material(path, resolve(path, flags=[only])).fits[0]
    assert fit.status == "converged"
    assert fit.shape["alpha"] == pytest.approx(alpha, rel=1e-3)
    assert fit.colours["diffuse_albedo"] == pytest.approx(ball.truth.colours["diffuse_albedo"], rel=1e-3)
    assert fit.colours["specular_strength"] == pytest.approx(np.full(3, ball.weight), rel=1e-3)


def test_another_lobe_would_be_noticed(tmp_path: Path) -> None:
    """The control: GGX fitted to Beckmann's picture misses its strength by more than 0.1 %."""
    ball = Ball(distribution="beckmann", alpha=0.25, light_off_axis_deg=58.0)
    path = tmp_path / "ball.exr"
    write_exr(path, render(ball, samples=16).astype(np.float32))
    write_scene_toml(Path(f"{path}.toml"), ball.scene, None)
    only = Layer(name="--model", values={"fit": {"models": ["ggx"], "diffuse": ["lambert"]}})
    fit = fit_material(path, resolve(path, flags=[only])).fits[0]
    assert np.abs(fit.colours["specular_strength"] / ball.weight - 1).max() > 1e-3
