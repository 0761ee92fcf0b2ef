"""`fit-material plan SCENE`: what a photograph could tell before it is taken, and which second one would help most."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from toolkit.errors import BadInputError

from .flags import Texts
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.plan import Plan, Setup
    from pipelines.settings import Settings
    from toolkit.records import Floats

SHOWN = 5  # second lights on the terminal; all of them in the JSON


def plan(
    scene: Annotated[Path, Parameter(help="Scene file with [image], [material], [sphere] and [[light]].")],
    /,
    *,
    set: Annotated[Texts, Parameter(metavar="TABLE.KEY=VALUE", help="Any setting. Repeatable.")] = (),  # noqa: A002  # the flag's name
    json: Annotated[bool, Parameter(help="Print one JSON object, every second light in it.")] = False,
    debug: Annotated[bool, Parameter(help="Show the traceback of an error.")] = False,
) -> int:
    """Tell how well a photograph could ever tell, before it is taken: the least sd of every parameter.

    Also under which second light another photograph, fitted jointly, would help most.
    """
    from pipelines.layers import assignment, resolve
    from pipelines.plan import plan as plan_of

    terminal = Terminal(json=json, debug=debug)
    setup = _setup(resolve(scene=scene, flags=[*map(assignment, set)]))
    found = plan_of(setup)
    if json:
        terminal.object(_object(found, setup))
    else:
        terminal.result("\n".join(_told(found, setup)) + "\n")
    return 0


def _setup(settings: Settings) -> Setup:
    from pipelines.made_of import made_of
    from pipelines.plan import Setup
    from pipelines.settings import noise_of_settings
    from synthetic.camera import GOOD_CAMERA, Sensor, with_rounding

    scene, material, (width_px, height_px) = made_of(settings)
    if any(light.kind not in ("directional", "point") for light in settings.light):
        raise BadInputError("plan moves the light; expected a directional or a point light first")
    kind = settings.image.format or "dng"
    steps = {"dng": Sensor().step, "png": 1.0 / 65535.0, "exr": 0.0}
    return Setup(
        scene=scene,
        material=material,
        noise=with_rounding(noise_of_settings(settings) or GOOD_CAMERA, steps[kind]),
        width_px=width_px,
        height_px=height_px,
        format=kind,
        exposure=settings.image.exposure,
        neutral=settings.fit.specular == "neutral",
        fixed=settings.fit.fix,
    )


def _object(found: Plan, setup: Setup) -> dict[str, Any]:
    from pipelines.report.result import finite

    seconds = [
        {"direction": one.direction, "off_axis_deg": one.off_axis_deg, "gain": one.gain, "sd": one.sds}
        for one in found.seconds
    ]
    made = {
        "schema": "fit-material/plan/1",
        "model": setup.material.model,
        "diffuse": setup.material.diffuse,
        "scale": setup.scene.scale,
        "parameters": {
            name: {"value": value, "sd": found.sds.get(name), "sd_statistical": found.noise_sds.get(name)}
            for name, value in _values(found).items()
        },
        "second": seconds,
        "repeated": {"gain": found.repeated.gain, "sd": found.repeated.sds},
    }
    plain = finite(made)
    assert isinstance(plain, dict)  # noqa: S101  # a dict goes in, so a dict comes out; this tells the type checker
    return plain


def _values(found: Plan) -> dict[str, Floats | None]:
    """The true values of all that is told; None for what follows from others."""
    names = dict.fromkeys((*found.truth, *found.sds))
    return {name: found.truth.get(name) for name in names}


def _told(found: Plan, setup: Setup) -> Iterator[str]:
    lights = "light" if len(setup.scene.lights) == 1 else "lights"
    size = f"{setup.width_px} x {setup.height_px} px"
    yield f"{setup.material.model} over {setup.material.diffuse}, {size}, {len(setup.scene.lights)} {lights}"
    yield ""
    yield f"{'least sd of':<26}{'value':>12}{'one photograph':>18}{'by noise alone':>18}{'with a second':>18}"
    best = found.seconds[0]
    for name, value in _values(found).items():
        cells = (found.sds, found.noise_sds, best.sds)
        yield f"{name:<26}{_text(value):>12}" + "".join(f"{_sd(name, sds):>18}" for sds in cells)
    yield ""
    yield f"{'second light, fitted jointly':<34}{'direction':<26}all sds"
    for one in found.seconds[:SHOWN]:
        towards = ", ".join(f"{v:.2f}" for v in one.direction)
        yield _line(f"{one.off_axis_deg:.0f} degrees off the view axis", f"({towards})", one.gain)
    yield _line("the same photograph once more", "", found.repeated.gain)


def _line(what: str, towards: str, gain: float) -> str:
    return f"{what:<34}{towards:<26}x {math.exp(-gain):.2f}"


def _sd(name: str, sds: Mapping[str, Floats]) -> str:
    return _text(sds[name]) if name in sds else "not identified"


def _text(value: Floats | None) -> str:
    """A number to three digits; of a colour the mean."""
    return "" if value is None else f"{float(value.mean()):.3g}"
