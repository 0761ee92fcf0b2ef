"""Glare beside clipped highlights: found where rays were put in, hardly ever where there are none, good for a fit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from synthetic.camera import blurred, exposure_for, with_rays
from synthetic.render import Render, render
from synthetic.scenes import direction, exposed
from tests.inference.ball import BODY, glossy, photograph, scene_of
from toolkit.flags import SampleFlag
from toolkit.geometry.glare import without_glare
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.radiometry.clipping import colour_flags
from toolkit.records import Fit, Floats, LinearImage, Plane, Scene

SIZE_PX, OVER = 180, 8.0  # a ball of 76 px radius; the highlight's top over what clips
RAYS = {"angle_deg": 15.0, "share": 0.2, "length_px": 14}
LOBES = {  # highlights of many widths and tails
    "ggx": {"alpha": 0.02},
    "beckmann": {"alpha": 0.1},
    "torrance-sparrow": {"roughness_rad": 0.05},
    "phong": {"shininess": 250.0},
    "gtr": {"alpha": 0.05, "tail": 1.6},
}


@cache
def picture_of(model: str, light_deg: float) -> tuple[Render, Scene]:
    """A glossy ball as a lens shows it, without rays."""
    scene = scene_of(SIZE_PX, light_deg=light_deg)
    whole = render(scene, glossy(model, **LOBES[model]), width_px=SIZE_PX, height_px=SIZE_PX, supersample=4)
    return blurred(whole, sd_px=0.6), scene


def exposed_to_clip(picture: Render, exposure: float, *, mosaic: bool = False, seed: int = 1) -> LinearImage:
    """A photograph that clips at 1."""
    image = photograph(exposure * picture.radiance(), seed=seed, mosaic=mosaic)
    return replace(image, planes=tuple(_clipped(image, v) for v in range(len(image.planes))))


def _clipped(image: LinearImage, v: int) -> Plane:
    plane = image.planes[v]
    values = np.minimum(plane.values, np.float32(1.0))
    flags = colour_flags(np.repeat(values[..., None], 3, axis=2), np.ones(3))[..., 0]
    return replace(plane, values=values, flags=flags)


def glare(image: LinearImage, scene: Scene) -> list[Floats]:
    """Where each plane's samples are flagged."""
    return [(plane.flags & SampleFlag.GLARE) > 0 for plane in without_glare(image, scene).planes]


def test_rays_are_found_and_little_else() -> None:
    """Seven of ten samples that rays brighten by half, and of what is flagged nine tenths are brightened by a tenth."""
    plain, scene = picture_of("ggx", 35.0)
    rayed = with_rays(plain, **RAYS)
    image = exposed_to_clip(rayed, OVER * exposure_for(plain, highlight=1.0))
    share = (rayed.radiance() / np.maximum(plain.radiance(), 1e-9) - 1.0)[..., 1]
    flagged, clipped = glare(image, scene)[1], (image.planes[1].flags & SampleFlag.CLIPPED) > 0
    row, column = np.nonzero(clipped)
    down, across = np.ogrid[:SIZE_PX, :SIZE_PX]
    near = np.hypot(down - row.mean(), across - column.mean()) < 20.0
    assert np.mean(flagged[near & ~clipped & (share > 0.5)]) > 0.7
    assert np.count_nonzero(flagged) > 20
    assert np.mean(share[flagged] > 0.1) > 0.9


@pytest.mark.parametrize("mosaic", [False, True])
def test_clean_highlights_hardly_ever_pass_for_glare(mosaic: bool) -> None:
    """Over lobes, lights and exposures less than one in 1,000 samples about the core, and nowhere one in 100."""
    shares = []
    for model, light_deg, over in product(LOBES, (5.0, 40.0, 75.0), (1.5, 6.0)):
        picture, scene = picture_of(model, light_deg)
        image = exposed_to_clip(picture, over * exposure_for(picture, highlight=1.0), mosaic=mosaic)
        near = np.pi * (0.26 * scene.sphere.radius_px) ** 2 * (1.0 if mosaic else 3.0)
        shares.append(sum(np.count_nonzero(mask) for mask in glare(image, scene)) / near)
    assert np.mean(shares) < 1e-3
    assert np.max(shares) < 1e-2


def test_another_lamps_highlight_is_no_glare() -> None:
    """Of what lies around two lamps' highlights, halfway to each other, hardly one sample in 100."""
    scene = scene_of(SIZE_PX)
    second = DirectionalLight(direction=direction(50.0, 30.0), irradiance=(1.0, 1.0, 1.0))
    scene = replace(scene, lights=(*scene.lights, second))
    picture = render(scene, glossy("ggx", alpha=0.05), width_px=SIZE_PX, height_px=SIZE_PX, supersample=4)
    image = exposed_to_clip(picture, OVER * exposure_for(picture, highlight=1.0))
    middles = [np.add(light.direction, (0.0, 0.0, 1.0)) for light in scene.lights]
    a, b = (middle / np.linalg.norm(middle) for middle in middles)
    near = 2 * 3 * np.pi * (0.5 * np.arccos(a @ b) * scene.sphere.radius_px) ** 2
    assert sum(np.count_nonzero(mask) for mask in glare(image, scene)) < 0.01 * near


def test_texture_away_from_the_core_is_no_glare() -> None:
    """A body patterned by a fifth, in patches: only what touches the core can be taken for a ray."""
    picture, scene = picture_of("beckmann", 35.0)
    rng = np.random.default_rng(3)
    patches = np.kron(1.0 + 0.2 * rng.uniform(-1, 1, (60, 60)), np.ones((3, 3)))[..., None]
    h, w = picture.diffuse.shape[:2]
    textured = replace(picture, diffuse=picture.diffuse * patches[:h, :w])
    image = exposed_to_clip(textured, OVER * exposure_for(picture, highlight=1.0))
    assert sum(np.count_nonzero(mask) for mask in glare(image, scene)) <= 3 * 9  # one patch


def test_where_nothing_clips_the_photograph_stays_as_it_is() -> None:
    """Whatever rays it has: they are told only beside a core that clips."""
    plain, scene = picture_of("ggx", 35.0)
    image = photograph(0.5 * exposure_for(plain, highlight=1.0) * with_rays(plain, **RAYS).radiance(), seed=1)
    assert without_glare(image, scene) is image


def test_a_fit_beside_rays_finds_the_truth_once_they_are_left_out() -> None:
    """Roughness to 5 % and F0 to 10 %; with the rays taken for the material roughness is off by over 15 %."""
    scene = scene_of(SIZE_PX)
    plain = render(scene, glossy("ggx", alpha=0.02), width_px=SIZE_PX, height_px=SIZE_PX, supersample=4)
    exposure = OVER * exposure_for(plain, highlight=1.0)
    image, scene = exposed_to_clip(with_rays(plain, **RAYS), exposure), exposed(scene, exposure)

    def found(taken: LinearImage) -> Fit:
        return infer(taken, scene, gather_for(taken, scene), Model.named("ggx"), seed=1, effective=300)

    assert abs(np.log(found(image).shape["alpha"] / 0.02)) > 0.15
    clean = found(without_glare(image, scene))
    assert abs(np.log(clean.shape["alpha"] / 0.02)) < 0.05
    assert np.all(np.abs(clean.colours["specular_f0"] / 0.04 - 1.0) < 0.1)
    assert np.all(np.abs(clean.colours["diffuse_albedo"] / np.array(BODY) - 1.0) < 0.02)
