"""`fit-material light CHROME.dng`: where the lamp stands, read off a mirror ball, as a scene file to reuse."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from pipelines.told import numbers
from toolkit.errors import UsageError

from .flags import Texts
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.lamp import Ball
    from pipelines.settings import Settings


def light(
    images: Annotated[tuple[str, ...], Parameter(help="Photographs of a mirror ball, all under one lamp.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(metavar="FILE", help="Scene file (TOML) to write the lamp to.")] = None,
    sphere: Annotated[
        Texts,
        Parameter(
            metavar="CX,CY,R",
            allow_leading_hyphen=True,
            help="Where a ball's centre projects and its radius, in pixels. Repeatable: the balls of one photograph, "
            "or one for each photograph. Without it the ball is detected.",
        ),
    ] = (),
    pick: Annotated[
        str | None, Parameter(metavar="X,Y", help="A place on the ball to detect, in pixels. [default: the largest]")
    ] = None,
    scene: Annotated[Path | None, Parameter(metavar="FILE", help="Scene file with camera, sphere, noise.")] = None,
    set: Annotated[Texts, Parameter(metavar="TABLE.KEY=VALUE", help="Any setting. Repeatable.")] = (),  # noqa: A002  # the flag's name
    transfer: Annotated[
        Literal["srgb"] | None, Parameter(help="Undo this curve in 8-bit or encoded images; marked.")
    ] = None,
    overwrite: Annotated[bool, Parameter(help="Replace a scene file that is there.")] = False,
    json: Annotated[bool, Parameter(help="Print the answer as one JSON object.")] = False,
    quiet: Annotated[bool, Parameter(name=["--quiet", "-q"], help="Errors and JSON only.")] = False,
    debug: Annotated[bool, Parameter(help="Show the traceback of an error.")] = False,
) -> int:
    """Tell where a lamp stands from its image on a mirror ball: direction, size, errors.

    Two balls, or two photographs with the ball moved, also tell a near lamp's distance. Example:
    fit-material light chrome.dng --out lamp.toml, then fit-material ball.dng --scene lamp.toml
    """
    terminal = Terminal(json=json, quiet=quiet, debug=debug)
    if out is not None:
        _refuse(out, overwrite=overwrite)
    circles = _shared_out(images, sphere)
    every: list[Ball] = []
    from pipelines.lamp import as_object, balls_in, lamp_of, scene_text

    for name in images:
        each = [_settings(Path(name), scene, set, transfer, circle, pick) for circle in circles.get(name) or (None,)]
        every += balls_in(Path(name), each)
    lamp = lamp_of(every)
    if out is not None:
        _write(out, scene_text(lamp, [ball.name for ball in every]))
    answer = as_object(lamp)
    if json:
        terminal.object(answer)
    elif not quiet:
        terminal.result("\n".join(told(answer, out)) + "\n")
    for note in lamp.notes if not quiet else ():
        terminal.say(f"note: {note}")
    return 0


def _refuse(out: Path, *, overwrite: bool) -> None:
    if out.exists() and (not overwrite or out.is_dir()):
        raise UsageError(f"{out} exists; expected a new name, or --overwrite to replace it")
    if not out.absolute().parent.is_dir():
        raise UsageError(f"--out: the folder {out.absolute().parent} does not exist; expected one that does")


def _shared_out(images: Sequence[str], spheres: Texts) -> dict[str, Texts]:
    """The circles of each photograph: all of a single one's, else one each."""
    if len(dict.fromkeys(images)) < len(images):
        raise UsageError("a photograph is named twice; expected each once, with a --sphere for each of its balls")
    if len(images) == 1:
        return {images[0]: spheres}
    if spheres and len(spheres) != len(images):
        raise UsageError(
            f"--sphere: found {len(spheres)} for {len(images)} photographs; expected one for each, in their order"
        )
    return {image: (sphere,) for image, sphere in zip(images, spheres, strict=False)}


def _settings(
    image: Path, scene: Path | None, assignments: Texts, transfer: str | None, circle: str | None, pick: str | None
) -> Settings:
    from pipelines.layers import Layer, assignment, resolve

    flags = [Layer(name="--transfer", values={"image": {"transfer": transfer}})] if transfer else []
    if circle is not None:
        x, y, radius = numbers("--sphere", circle, "CX,CY,R")
        flags.append(Layer(name="--sphere", values={"sphere": {"centre_px": [x, y], "radius_px": radius}}))
    if pick is not None:
        flags.append(Layer(name="--pick", values={"image": {"pick_px": numbers("--pick", pick, "X,Y")}}))
    return resolve(image, scene=scene, flags=[*flags, *map(assignment, assignments)])


def _write(out: Path, text: str) -> None:
    from pipelines.report.folder import whole

    with whole(out.absolute().parent, last=out.name) as draft:
        (draft / out.name).write_text(text, encoding="utf-8")


def told(answer: Mapping[str, Any], out: Path | None) -> Iterator[str]:
    """The answer in lines."""
    from pipelines.report.text import clean

    x, y, z = answer["light"]["direction"]
    sd = f"± {answer['sd_deg']:.2g}° each axis; x right, y up, z to the camera"
    yield f"{'direction':18}{x:.5f}, {y:.5f}, {z:.5f}  {sd}"
    yield from _lamp_rows(answer)
    for ball in answer["balls"]:
        yield from _ball_rows(ball)
    if out is not None:
        yield f"{clean(out)}: scene file; use it as  fit-material IMAGE --scene {clean(out)}"


def _lamp_rows(answer: Mapping[str, Any]) -> Iterator[str]:
    distance, first = answer["distance_radii"], answer["balls"][0]
    if distance["estimate"] is not None:
        place = ", ".join(f"{v:.3f}" for v in answer["light"]["position"])
        yield f"{'position':18}{place}  ball radii from the first ball's centre"
        yield f"{'distance':18}{distance['estimate']:.2f} ± {distance['sd']:.2g} ball radii"
    elif distance["at_least"] is not None:
        yield f"{'distance':18}beyond {distance['at_least']:.0f} ball radii; taken as far"
    if first["angular_radius_deg"] is not None:
        size = f"{first['angular_radius_deg']:.3g}° ± {first['angular_radius_sd_deg']:.2g}°"
        yield f"{'angular radius':18}{size}, the camera's blur of {first['blur_px']:.2f} px taken out"
    else:
        yield f"{'angular radius':18}not resolved: below {first['angular_radius_at_most_deg']:.2g}°"


def _ball_rows(ball: Mapping[str, Any]) -> Iterator[str]:
    from pipelines.report.text import clean

    (cx, cy), (x, y), sphere = ball["sphere"]["centre_px"], ball["highlight_px"], ball["sphere"]
    sd = max(ball["highlight_sd_px"])
    channels = [name for name, cut in zip("RGB", ball["clipped"], strict=True) if cut]
    clipped = f", clipped in {', '.join(channels)}" if channels else ""
    yield clean(ball["image"])
    circle = f"centre {cx:.2f}, {cy:.2f}, radius {sphere['radius_px']:.2f} px, {sphere['source']}"
    yield f"  {'ball':16}{circle}; {ball['projection']}"
    yield f"  {'highlight':16}{x:.2f}, {y:.2f}  ± {sd:.2g} px{clipped}"
    by = f"{ball['sd_highlight_deg']:.2g}° by the highlight, {ball['sd_outline_deg']:.2g}° by the outline"
    yield f"  {'error':16}{by}"
