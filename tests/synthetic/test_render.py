"""Renders against closed forms, and against themselves at finer subdivision."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from synthetic.materials import Material, material
from synthetic.render import Render, render
from synthetic.scenes import direction, sphere_in
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.records import Scene

E = (2.0, 1.5, 1.0)
MATTE = material("phong", {"shininess": 5.0, "specular_albedo": 0.0, "diffuse_albedo": (0.9, 0.5, 0.2)})
GLOSSY = material("torrance-sparrow", {"roughness_rad": 0.12, "diffuse_albedo": (0.6, 0.2, 0.1), "specular_f0": 0.04})


def lit(off_axis_deg: float, radius_px: float = 40.0, size_px: int = 100, **scene: object) -> Scene:
    light = DirectionalLight(direction=direction(off_axis_deg, 25.0), irradiance=E)
    return sphere_in(size_px, size_px, radius_px=radius_px, lights=[light], offset_px=(0.3, -0.2), **scene)


def picture(scene: Scene, made_of: Material = GLOSSY, size_px: int = 100, **options: object) -> Render:
    return render(scene, made_of, width_px=size_px, height_px=size_px, **options)


@pytest.mark.parametrize("phase_deg", [0.0, 35.0, 90.0, 140.0])
def test_a_lambert_sphere_sends_out_what_its_phase_function_says(phase_deg: float) -> None:
    """Total flux is 2/3 albedo E R^2 (sin g + (pi - g) cos g) / pi at phase angle g (Lambert 1760)."""
    g = np.radians(phase_deg)
    phase = (np.sin(g) + (np.pi - g) * np.cos(g)) / np.pi
    expected = 2 / 3 * np.array([0.9, 0.5, 0.2]) * E * 40.0**2 * phase
    found = picture(lit(phase_deg), MATTE, supersample=32).radiance().sum(axis=(0, 1))
    np.testing.assert_allclose(found, expected, rtol=5e-5)


@pytest.mark.parametrize("shininess", [1.0, 50.0, 5000.0, 1e5])
@pytest.mark.parametrize("model", ["phong", "blinn-phong"])
def test_a_highlight_keeps_its_flux_however_small_it_is(model: str, shininess: float) -> None:
    """Lit along the view, cos^n 2 theta and cos^n theta integrate in closed form, even within one pixel."""
    numbers = {"shininess": shininess, "specular_albedo": 0.7, "diffuse_albedo": 0.0}
    expected = (
        np.pi * 40.0**2 * 0.7 * np.array(E) * (0.5 / (shininess + 1) if model == "phong" else 2 / (shininess + 2))
    )
    found = picture(lit(0.0), material(model, numbers)).radiance().sum(axis=(0, 1))
    np.testing.assert_allclose(found, expected, rtol=3e-4)


def test_the_outline_in_perspective_covers_the_ellipse_of_a_tangent_cone() -> None:
    """Off the axis the outline's semi-axes are those of the plane cutting the cone of the sphere's tangents."""
    scene = sphere_in(400, 400, radius_px=50.0, offset_px=(110.3, -90.7), focal_length_px=300.0)
    a, b = np.arctan(50.0 / 300.0), np.arctan(np.hypot(110.3, 90.7) / 300.0)
    expected = np.pi * 300.0**2 * np.sin(a) ** 2 * np.cos(a) / (np.cos(b) ** 2 - np.sin(a) ** 2) ** 1.5
    assert picture(scene, size_px=400).coverage.sum() == pytest.approx(expected, rel=2e-5)


def test_finer_subdivision_converges() -> None:
    """Each halving at least halves the errors on the limb's pixels (on average) and on whole ones (at most)."""
    finest = picture(lit(50.0), supersample=128)
    radiance, whole = finest.box_radiance(), finest.coverage == 1.0
    errors = [np.abs(picture(lit(50.0), supersample=2**level).box_radiance() - radiance) for level in range(6)]
    for measure in ([e[whole].max() for e in errors], [e[~whole].mean() for e in errors]):
        assert all(finer < 0.5 * coarser for coarser, finer in itertools.pairwise(measure))
    assert errors[3][whole].max() < 5e-4 * radiance.max()  # the default, on a sphere of only 40 px


def test_shadow_is_black_and_begins_where_the_light_grazes() -> None:
    """A light from the right leaves the left half dark, to the pixel."""
    light = DirectionalLight(direction=(1.0, 0.0, 0.0), irradiance=E)
    scene = sphere_in(101, 101, radius_px=40.0, lights=[light])
    radiance = picture(scene, MATTE, size_px=101).radiance()
    assert (radiance[:, :50] == 0.0).all()
    assert (radiance[30:70, 50] > 0.0).all()
    # the pixel that the terminator halves: mean over its lit half of x / R, along the equator
    assert radiance[50, 50, 0] == pytest.approx(0.9 * E[0] / np.pi * (1 / 8) / 40.0, rel=1e-3)


def test_lights_add() -> None:
    """Two lights together give the sum of each alone."""
    lamps = (
        DirectionalLight(direction=direction(40.0, 100.0), irradiance=(1.0, 2.0, 3.0)),
        PointLight(position=(3.0, -1.0, 4.0), irradiance=(0.5, 0.4, 0.3)),
    )
    each = [picture(sphere_in(100, 100, radius_px=40.0, lights=[lamp])).radiance() for lamp in lamps]
    both = picture(sphere_in(100, 100, radius_px=40.0, lights=lamps)).radiance()
    np.testing.assert_allclose(both, each[0] + each[1], atol=2e-5)


def test_a_near_light_falls_off_and_a_far_one_is_directional() -> None:
    """At 3 radii the nearest point gets (3/2)^2 of the centre's irradiance; at 10^5 radii nothing is left of it."""
    near = PointLight(position=(0.0, 0.0, 3.0), irradiance=(1.0, 1.0, 1.0))
    facing = picture(sphere_in(101, 101, radius_px=40.0, lights=[near]), MATTE, size_px=101).radiance()[50, 50, 0]
    assert facing == pytest.approx(0.9 / np.pi * 9 / 4, rel=1e-3)
    towards = direction(35.0, 70.0)
    far = PointLight(position=tuple(1e5 * v for v in towards), irradiance=E)
    same = DirectionalLight(direction=towards, irradiance=E)
    pair = [picture(sphere_in(100, 100, radius_px=40.0, lights=[lamp])).radiance() for lamp in (far, same)]
    np.testing.assert_allclose(pair[0], pair[1], rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("kind", ["directional", "point"])
def test_an_extended_light_blurs_the_highlight_like_many_small_ones(kind: str) -> None:
    """A disc of 6 degrees equals the mean over 600 small lights spread over it, and keeps its irradiance."""
    towards, sharp = np.array(direction(30.0, 60.0)), 0.05
    gloss = material("torrance-sparrow", {"roughness_rad": sharp, "diffuse_albedo": 0.4, "specular_f0": 0.04})

    def lamp(to: np.ndarray, share: float, angular_radius_deg: float = 0.0) -> DirectionalLight | PointLight:
        power = (share, share, share)
        if kind == "point":
            return PointLight(position=tuple(5.0 * to), irradiance=power, angular_radius_deg=angular_radius_deg)
        unit = tuple(to / np.linalg.norm(to))
        return DirectionalLight(direction=unit, irradiance=power, angular_radius_deg=angular_radius_deg)

    across = np.linalg.svd(towards[None])[2][1:]
    k = np.arange(600) + 0.5
    r, around = np.tan(np.radians(6.0)) * np.sqrt(k / 600), k * np.pi * (3 - np.sqrt(5))
    offsets = r[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    share = 1.0 / np.sum(1.0 / np.sqrt(1.0 + r**2))
    many = [lamp(towards + o, share) for o in offsets @ across]
    views = [sphere_in(40, 40, radius_px=16.0, lights=lamps) for lamps in ([lamp(towards, 1.0, 6.0)], many)]
    disc, brute = (picture(view, gloss, size_px=40, supersample=1).radiance()[..., 0] for view in views)
    small = picture(sphere_in(40, 40, radius_px=16.0, lights=[lamp(towards, 1.0)]), gloss, size_px=40).radiance()
    np.testing.assert_allclose(disc, brute, atol=2e-3 * brute.max())
    assert disc.max() < 0.9 * small.max()


def test_a_mirror_shows_the_lamp_at_its_own_radiance() -> None:
    """A lamp of 6 degrees mirrored sharply has its radiance E / (pi sin^2 R); the body sees its irradiance."""
    lamp = DirectionalLight(direction=direction(30.0), irradiance=E, angular_radius_deg=6.0)
    numbers = {"blur_rad": 0.003, "diffuse_albedo": 0.5, "specular_strength": 0.8}
    shown = picture(sphere_in(100, 100, radius_px=40.0, lights=[lamp]), material("mirror", numbers))
    x, y = 49.5 + 40.0 * np.sin(np.radians(15.0)) - shown.origin_px[0], 49.5 - shown.origin_px[1]
    radiance = 0.8 * np.array(E) / (np.pi * np.sin(np.radians(6.0)) ** 2)
    np.testing.assert_allclose(shown.specular[int(y), int(x)], radiance, rtol=1e-3)
    np.testing.assert_allclose(shown.diffuse.max(axis=(0, 1)), 0.5 / np.pi * np.array(E), rtol=2e-3)


def test_fresnel_follows_the_colour_that_the_material_names() -> None:
    """Seen and lit from straight above index 1.5 and F0 0.04 are one; at 70 degrees Schlick and exact part."""
    base = {"roughness_rad": 0.1, "diffuse_albedo": 0.0}
    kinds = {"specular_index": 1.5, "specular_f0": 0.04, "specular_strength": 0.04}
    made = [material("torrance-sparrow", base | {kind: value}) for kind, value in kinds.items()]
    above = [picture(lit(0.0), one).specular for one in made]
    np.testing.assert_allclose(above[0], above[2], rtol=1e-4)
    np.testing.assert_allclose(above[1], above[2], rtol=1e-4)
    exact, schlick, constant = (picture(lit(140.0), one).specular.max() for one in made)
    c = np.cos(np.radians(70.0))
    t = np.sqrt(1.5**2 - 1 + c * c)
    reflectance = 0.5 * ((c - t) / (c + t)) ** 2 + 0.5 * ((2.25 * c - t) / (2.25 * c + t)) ** 2
    assert exact / constant == pytest.approx(reflectance / 0.04, rel=1e-6)
    assert schlick / constant == pytest.approx((0.04 + 0.96 * (1 - c) ** 5) / 0.04, rel=1e-6)


def test_layers_background_and_pedestal_make_up_the_picture() -> None:
    """Around the sphere stand background and pedestal; on it the layers and the pedestal, at the limb a mixture."""
    shown = picture(lit(30.0), background=np.array([0.3, 0.2, 0.1]), pedestal=0.05)
    radiance = shown.radiance()
    np.testing.assert_allclose(radiance[0, 0], [0.35, 0.25, 0.15])
    bare = picture(lit(30.0))
    around = 1.0 - bare.full(bare.coverage[..., None])
    np.testing.assert_allclose(radiance, bare.radiance() + around * [0.3, 0.2, 0.1] + 0.05, atol=1e-12)
    np.testing.assert_allclose(bare.full(bare.diffuse + bare.specular), bare.radiance())
    matte, gloss = bare.diffuse[bare.coverage == 1.0], bare.specular[bare.coverage == 1.0]
    np.testing.assert_allclose(matte / matte[:, :1].clip(1e-300), np.where(matte[:, :1] > 0, [1, 0.25, 1 / 12], 0))
    assert gloss.max() > 0.1


def test_a_sphere_cut_by_the_frame_is_the_same_where_it_is_seen() -> None:
    """The frame's edge changes nothing inside it."""
    light = DirectionalLight(direction=direction(30.0), irradiance=E)
    whole = sphere_in(100, 100, radius_px=40.0, lights=[light])
    cut = sphere_in(60, 60, radius_px=40.0, lights=[light], offset_px=(20.0, 20.0))
    np.testing.assert_allclose(
        picture(cut, size_px=60).radiance(), picture(whole).radiance()[:60, :60], rtol=1e-9, atol=1e-12
    )


def test_the_same_scene_gives_the_same_picture() -> None:
    """Threads change no bit."""
    first, second = (picture(lit(30.0, radius_px=180.0, size_px=400), size_px=400).radiance() for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_a_subdivision_that_is_no_power_of_two_is_refused() -> None:
    """Pixels are quartered."""
    with pytest.raises(ValueError, match="supersample is 3"):
        picture(lit(30.0), supersample=3)
