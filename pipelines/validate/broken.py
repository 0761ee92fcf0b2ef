"""Each assumption of the method, broken by a known amount: what then happens to the answer, and is it flagged?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from synthetic.ellipsoid import ellipsoid
from synthetic.lights import across, movable, moved, scaled, vector
from synthetic.render import Render, render
from synthetic.scenes import direction
from toolkit.records import Floats, Scene

from .shot import Shot

SPOTS_PER_RADIUS = 6.0  # grain of the texture


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumption:
    """What is taken for granted, by how much it is broken, and how."""

    says: str
    unit: str
    amounts: tuple[float, ...]
    broken: Callable[[Shot, float], Shot]


def light_off(shot: Shot, amount_deg: float) -> Shot:
    """The light's direction is told wrongly."""
    (light,) = shot.told.lights
    angle = shot.rng.uniform(0.0, 2.0 * np.pi)
    aside = np.array([np.cos(angle), np.sin(angle)]) @ across(vector(light))
    turned = moved(light, vector(light) / np.linalg.norm(vector(light)) + np.tan(np.radians(amount_deg)) * aside)
    return replace(shot, told=replace(shot.told, lights=(turned,)))


def radius_off(shot: Shot, amount_px: float) -> Shot:
    """The sphere's radius is told too large."""
    return replace(
        shot,
        told=replace(shot.told, sphere=replace(shot.told.sphere, radius_px=shot.told.sphere.radius_px + amount_px)),
    )


def gamma_left_in(shot: Shot, amount: float) -> Shot:
    """The samples went through a transfer curve that nobody undid."""
    return replace(shot, gamma=amount)


def clipped(shot: Shot, amount_percent: float) -> Shot:
    """Exposed so that this share of the sphere's samples saturates."""
    inside = shot.picture.coverage > 0.5
    bright = np.quantile(shot.picture.box_radiance()[inside], 1.0 - 0.01 * amount_percent)
    return replace(shot, exposure=1.0 / float(bright))


def demosaiced(shot: Shot, amount: float) -> Shot:
    """Not raw samples but a converter's interpolated picture, told as if every number had been measured."""
    return replace(shot, demosaiced=bool(amount))


def stray_light(shot: Shot, amount_percent: float) -> Shot:
    """A veil of this share of the brightest body radiance in the middle, twice that on one side, none on the other."""
    picture = shot.picture
    veil = 0.01 * amount_percent * float(picture.diffuse.max())
    along, _ = _plane(shot, picture.diffuse.shape[:2])
    there = np.clip(1.0 + along, 0.0, 2.0)[..., None] * picture.coverage[..., None]
    return replace(shot, picture=replace(picture, diffuse=picture.diffuse + veil * there))


def textured(shot: Shot, amount_percent: float) -> Shot:
    """The albedo varies by this relative sd over the surface, in grains of a sixth of the radius."""
    from scipy.ndimage import gaussian_filter

    picture = shot.picture
    grain_px = shot.scene.sphere.radius_px / SPOTS_PER_RADIUS
    field = gaussian_filter(shot.rng.standard_normal(picture.diffuse.shape[:2]), 0.5 * grain_px)
    field *= 0.01 * amount_percent / field.std()
    return replace(shot, picture=replace(picture, diffuse=picture.diffuse * np.maximum(1.0 + field, 0.0)[..., None]))


def egg_shaped(shot: Shot, amount_percent: float) -> Shot:
    """One axis across the view is longer than the other two by this."""
    turned = float(shot.rng.uniform(0.0, 180.0))
    drawn = ellipsoid(shot.picture, shot.scene, shot.material, stretch=0.01 * amount_percent, around_deg=turned)
    return replace(shot, picture=drawn)


def second_lamp(shot: Shot, amount_percent: float) -> Shot:
    """Another far light, of this share of the first one's irradiance, that nobody mentions."""
    (light,) = shot.scene.lights
    other = moved(light, np.array(direction(shot.rng.uniform(20.0, 70.0), shot.rng.uniform(0.0, 360.0))))
    both = replace(shot.scene, lights=(light, scaled(movable(other), 0.01 * amount_percent)))
    return replace(shot, picture=_again(shot, both))


def _again(shot: Shot, scene: Scene) -> Render:
    picture = shot.picture
    drawn = render(scene, shot.material, width_px=picture.width_px, height_px=picture.height_px)
    return replace(drawn, pedestal=picture.pedestal)


def _plane(shot: Shot, shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Places on the box in sphere radii, along and across an axis of any direction."""
    (x0, y0), (cx, cy) = shot.picture.origin_px, shot.scene.sphere.centre_px
    row, column = np.mgrid[: shape[0], : shape[1]]
    right, up = (x0 + column - cx) / shot.scene.sphere.radius_px, -(y0 + row - cy) / shot.scene.sphere.radius_px
    angle = shot.rng.uniform(0.0, 2.0 * np.pi)
    return right * np.cos(angle) + up * np.sin(angle), up * np.cos(angle) - right * np.sin(angle)


ASSUMPTIONS: Mapping[str, Assumption] = {
    "light": Assumption(says="light's direction wrong", unit="degrees", amounts=(0.5, 2.0), broken=light_off),
    "radius": Assumption(says="sphere's radius wrong", unit="px", amounts=(1.0, 3.0), broken=radius_off),
    "gamma": Assumption(says="transfer curve left in", unit="gamma", amounts=(2.2,), broken=gamma_left_in),
    "clipped": Assumption(says="clipped samples", unit="% of the sphere", amounts=(1.0, 4.0), broken=clipped),
    "demosaiced": Assumption(says="demosaiced input", unit="", amounts=(1.0,), broken=demosaiced),
    "stray": Assumption(says="stray light", unit="% of the body", amounts=(1.0, 5.0), broken=stray_light),
    "texture": Assumption(says="textured ball", unit="% of the albedo", amounts=(3.0, 10.0), broken=textured),
    "egg": Assumption(says="egg-shaped ball", unit="% of an axis", amounts=(2.0, 5.0), broken=egg_shaped),
    "lamp": Assumption(says="second lamp", unit="% of the first", amounts=(5.0, 20.0), broken=second_lamp),
}


def as_asked(shot: Shot, name: str, amount: float) -> Shot:
    """The shot with the named assumption broken, the same way each time; "" leaves it whole."""
    return ASSUMPTIONS[name].broken(replace(shot), amount) if name else shot
