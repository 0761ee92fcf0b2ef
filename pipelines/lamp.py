"""From photographs of mirror balls to a lamp: its direction, size and, where two rays tell it, its position.

file -> RawFrame -> LinearImage -> LampFound, one a ball -> Lamp.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import BadInputError
from toolkit.geometry.chrome import LampFound, lamp_in_ball
from toolkit.geometry.chrome_position import LampPlaced, place_lamp
from toolkit.geometry.lights import AnyLight, DirectionalLight, PointLight
from toolkit.records import Camera, LinearImage, RawFrame, Sphere

from .locate import detected
from .settings import Settings, camera_of, noise_of_settings, sphere_of

if TYPE_CHECKING:
    from toolkit.records import Noise

SCHEMA = "fit-material/light/1"
AROUND = 1.6  # ball radii round its centre that are looked at: a highlight beside the ball is to be seen as such
NEAR_NOTE = (
    "the position counts from the first ball's centre in its radii: put the ball to be fitted in that ball's place; "
    "of another size, multiply the position by mirror radius over ball radius"
)
GREATEST_SD_DEG = 20.0  # beyond it nothing is known worth writing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ball:
    """One mirror ball: its photograph's name, and the lamp seen in it."""

    name: str
    lamp: LampFound


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lamp:
    """The answer: the light as a scene file has it, the balls behind it, and the meeting of their rays."""

    light: AnyLight
    balls: tuple[Ball, ...]
    placed: LampPlaced | None  # None of a single ball
    notes: tuple[str, ...]


def balls_in(path: Path, settings: Sequence[Settings]) -> list[Ball]:
    """Every ball of one photograph, by settings that differ in their sphere alone; without any it is detected."""
    from toolkit.io.read import read

    frame, first = read(path), settings[0]
    height, width = frame.values.shape[:2]
    camera = camera_of(first, width_px=width, height_px=height, metadata=frame.metadata)
    known = [sphere for sphere in map(sphere_of, settings) if sphere is not None]
    noise = noise_of_settings(first)
    if not known:
        whole = _linear(frame, first, noise, None)
        known, noise = [detected(whole, camera, first.image.pick_px)[0]], whole.noise
    return [Ball(name=frame.name, lamp=_in_ball(frame, first, noise, sphere, camera)) for sphere in known]


def _in_ball(frame: RawFrame, settings: Settings, noise: Noise | None, sphere: Sphere, camera: Camera) -> LampFound:
    height, width = frame.values.shape[:2]
    (x, y), reach = sphere.centre_px, AROUND * sphere.radius_px
    box = max(int(x - reach), 0), max(int(y - reach), 0), min(int(x + reach), width), min(int(y + reach), height)
    if box[0] + 8 > box[2] or box[1] + 8 > box[3]:
        raise BadInputError(
            f"{frame.name}: the ball at ({x:.0f}, {y:.0f}) lies outside the {width} x {height} frame; "
            "expected its circle in pixels: --sphere CX,CY,R"
        )
    try:
        return lamp_in_ball(_linear(frame, settings, noise, box), sphere=sphere, camera=camera)
    except BadInputError as error:
        raise BadInputError(f"{frame.name}: {error}") from error


def _linear(
    frame: RawFrame, settings: Settings, noise: Noise | None, box: tuple[int, int, int, int] | None
) -> LinearImage:
    from toolkit.radiometry.linearise import linearise

    return linearise(frame, box=box, transfer=settings.image.transfer, noise=noise)


def lamp_of(balls: Sequence[Ball]) -> Lamp:
    """One lamp from all balls; raises BadInputError where they show different lamps."""
    if len(balls) == 1:
        found = balls[0].lamp
        far = _far(found.direction, found.sd_deg, found.angular_radius_deg)
        return Lamp(light=far, balls=tuple(balls), placed=None, notes=(*_notes(balls), _far_note(found)))
    placed = place_lamp([ball.lamp for ball in balls])
    if not placed.same_lamp:
        raise BadInputError(
            "the balls show lamps that do not meet (chi-square per degree of freedom "
            f"{placed.chi2_reduced:.0f}); expected one lamp, and balls of one size: give several lamps one by one"
        )
    if placed.diverging:
        raise BadInputError(
            "the balls' rays to the lamp part, as from no place at all; expected balls of one size with their own "
            "circles, and the camera's focal length: correct --sphere, or give camera.focal_length_px"
        )
    radius = balls[0].lamp.angular_radius_deg
    light: AnyLight = _far(placed.direction, placed.sd_deg, radius)
    if placed.near:
        light = PointLight(
            position=placed.position, direction_sd_deg=_sd(placed.sd_deg), angular_radius_deg=_size(radius)
        )
    near = (NEAR_NOTE,) if placed.near else ()
    return Lamp(light=light, balls=tuple(balls), placed=placed, notes=(*_notes(balls), *near))


def _far(direction: tuple[float, float, float], sd_deg: float, radius_deg: float | None) -> DirectionalLight:
    if sd_deg > GREATEST_SD_DEG:
        raise BadInputError(
            f"the direction is known to {sd_deg:.0f} degrees only; expected a sharper outline of the ball, "
            "or a lamp less behind it: give sphere.centre_sd_px and sphere.radius_sd_px"
        )
    return DirectionalLight(direction=direction, direction_sd_deg=_sd(sd_deg), angular_radius_deg=_size(radius_deg))


def _sd(sd_deg: float) -> float:
    return float(f"{sd_deg:.3g}")


def _size(radius_deg: float | None) -> float:
    return 0.0 if radius_deg is None else float(f"{radius_deg:.3g}")


def _notes(balls: Sequence[Ball]) -> tuple[str, ...]:
    """What a reader must know of the highlights."""
    found = []
    for ball in balls:
        if any(ball.lamp.image.clipped):
            found.append(
                f"{ball.name}: the highlight is clipped, its place is told by its border: expose less, to be surer"
            )
        if ball.lamp.image.rival:
            found.append(
                f"{ball.name}: a second highlight is nearly as bright; the brightest is taken: cover the other"
            )
    return tuple(found)


def _far_note(found: LampFound) -> str:
    """From where on a lamp is as good as far: the place that mirrors it lies beside the line to the ball's centre."""
    half = np.add(found.direction, (0.0, 0.0, 1.0))
    length = float(np.linalg.norm(half))
    beside = float(np.linalg.norm(np.cross(half / max(length, 1e-9), found.direction)))
    radii = beside / np.radians(max(found.sd_deg, 1e-3))
    return (
        f"taken as far: nearer than {radii:.0f} ball radii it is off by more than its error; "
        "a second photograph with the ball moved, or a second ball, tells the distance"
    )


def as_object(lamp: Lamp) -> dict[str, Any]:
    """The answer as a JSON object: the scene file's table, errors, and every ball."""
    from .report.result import finite

    light = lamp.light.model_dump(mode="json", exclude_none=True)
    told = {
        "schema": SCHEMA,
        "status": "ok",
        "error": None,
        "light": light | {"direction": list(lamp.light.direction)},
        "sd_deg": lamp.placed.sd_deg if lamp.placed else lamp.balls[0].lamp.sd_deg,
        "distance_radii": _distance(lamp.placed),
        "position_covariance": lamp.placed.position_covariance if lamp.placed and lamp.placed.near else None,
        "balls": [_ball(ball) for ball in lamp.balls],
        "notes": list(lamp.notes),
    }
    return {key: finite(value) for key, value in told.items()}


def _distance(placed: LampPlaced | None) -> dict[str, float | None]:
    if placed is None:
        return {"estimate": None, "sd": None, "at_least": None}
    value, sd = placed.distance if placed.near else (None, None)
    return {"estimate": value, "sd": sd, "at_least": placed.least_distance}


def _ball(ball: Ball) -> dict[str, Any]:
    lamp, seen = ball.lamp, ball.lamp.image
    highlight = float(np.degrees(np.sqrt(np.trace(lamp.highlight_covariance) / 2.0)))
    return {
        "image": ball.name,
        "sphere": {
            "centre_px": list(lamp.sphere.centre_px),
            "radius_px": lamp.sphere.radius_px,
            "source": lamp.sphere.source,
        },
        "projection": lamp.camera.projection,
        "highlight_px": list(seen.place_px),
        "highlight_sd_px": np.sqrt(np.diag(seen.covariance_px2)),
        "clipped": list(seen.clipped),
        "blur_px": seen.blur_px,
        "direction": list(lamp.direction),
        "covariance": lamp.covariance,
        "sd_deg": lamp.sd_deg,
        "sd_highlight_deg": highlight,
        "sd_outline_deg": float(np.sqrt(max(lamp.sd_deg**2 - highlight**2, 0.0))),
        "angular_radius_deg": lamp.angular_radius_deg,
        "angular_radius_sd_deg": _radius_sd(lamp),
        "angular_radius_at_most_deg": lamp.angular_radius_limit_deg,
        "chi2_reduced": seen.chi2_reduced,
    }


def _radius_sd(lamp: LampFound) -> float | None:
    radius = lamp.angular_radius_deg
    return None if radius is None else radius * lamp.image.radius_relative_sd


def scene_text(lamp: Lamp, names: Sequence[str]) -> str:
    """The lamp as a scene file, with a word of where it comes from above it."""
    import tomli_w

    from pipelines.report.text import clean

    told = "".join(f"# {line}\n" for line in _told(lamp, [clean(name) for name in names]))
    return told + tomli_w.dumps({"light": [lamp.light.model_dump(mode="json", exclude_none=True)]})


def _told(lamp: Lamp, names: Sequence[str]) -> list[str]:
    lines = [f"A lamp read off {', '.join(dict.fromkeys(names))} by fit-material light; camera frame."]
    if lamp.placed is not None and lamp.placed.near:
        distance, sd = lamp.placed.distance
        lines.append(f"Position in radii of the first ball, from its centre; distance {distance:.2f} +- {sd:.2f}.")
    return lines
