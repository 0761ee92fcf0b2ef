"""`fit-material render SCENE --out sphere.dng`: a photograph of known truth from a scene file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from toolkit.errors import UsageError

from .flags import Texts
from .terminal import Terminal

if TYPE_CHECKING:
    from pipelines.settings import Settings
    from toolkit.records import Floats

Format = Literal["dng", "exr", "png"]
FORMATS: tuple[Format, ...] = ("dng", "exr", "png")


def render(
    scene: Annotated[Path, Parameter(help="Scene file with [image], [material], [sphere] and [[light]].")],
    /,
    *,
    out: Annotated[Path, Parameter(metavar="FILE", help="The photograph to write: .dng, .exr or .png.")],
    set: Annotated[Texts, Parameter(metavar="TABLE.KEY=VALUE", help="Any setting. Repeatable.")] = (),  # noqa: A002  # the flag's name
    seed: Annotated[int | None, Parameter(metavar="N", help="Same seed, same noise. [default: 0]")] = None,
    overwrite: Annotated[bool, Parameter(help="Replace a photograph that is there.")] = False,
    json: Annotated[bool, Parameter(help="Print the truth as one JSON object.")] = False,
    debug: Annotated[bool, Parameter(help="Show the traceback of an error.")] = False,
) -> int:
    """Render the photograph of a sphere of known material, and a scene file OUT.toml beside it."""
    terminal = Terminal(json=json, debug=debug)
    settings = _settings(scene, set, seed)
    _refuse_existing(out, overwrite=overwrite)
    truth = _photograph(settings, out)
    if json:
        terminal.object(truth)
    else:
        terminal.result("\n".join(_told(truth, out)) + "\n")
    return 0


def _settings(scene: Path, assignments: Texts, seed: int | None) -> Settings:
    from pipelines.layers import Layer, assignment, resolve

    seeds = [] if seed is None else [Layer(name="--seed", values={"fit": {"seed": seed}})]
    return resolve(scene=scene, flags=[*seeds, *map(assignment, assignments)])


def _refuse_existing(out: Path, *, overwrite: bool) -> None:
    beside = out.with_name(f"{out.name}.toml")
    there = [path for path in (out, beside) if path.exists()]
    if there and not overwrite:
        raise UsageError(f"{there[0]} exists; expected a new name, or --overwrite to replace it")
    if not out.absolute().parent.is_dir():
        raise UsageError(f"--out: the folder {out.absolute().parent} does not exist; expected one that does")


def _photograph(settings: Settings, out: Path) -> dict[str, Any]:
    from pipelines.made_of import made_of
    from pipelines.settings import noise_of_settings
    from synthetic.photograph import render_photograph

    image = settings.image
    scene, material, (width_px, height_px) = made_of(settings)
    return render_photograph(
        scene,
        material,
        noise_of_settings(settings),
        width_px=width_px,
        height_px=height_px,
        format=image.format or _format_of(out),
        exposure=image.exposure,
        seed=settings.fit.seed,
        path=out,
        background=_array(image.background),
        pedestal=_array(image.pedestal),
        blur_sd_px=image.blur_sd_px,
    )


def _array(colour: tuple[float, float, float]) -> Floats:
    import numpy as np

    return np.array(colour)


def _format_of(out: Path) -> Format:
    suffix = out.suffix.lower().removeprefix(".")
    known = next((name for name in FORMATS if name == suffix), None)
    if known is None:
        raise UsageError(f"--out: {out.name} ends in {out.suffix or 'nothing'!r}; expected .dng, .exr or .png")
    return known


def _told(truth: Mapping[str, Any], out: Path) -> Iterator[str]:
    from pipelines.report.text import clean

    variant = "".join(f", {option} {choice}" for option, choice in truth["variant"].items())
    yield f"{clean(out)}: {truth['model']} over {truth['diffuse']}{variant}; scene file {clean(out.name)}.toml"
    for name, value in truth["parameters"].items():
        yield f"  {name:24}{_text(value)}"
    yield f"  {'exposure':24}{_text(truth['exposure'])}"
    yield f"  {'clipped samples':24}{truth['clipped']}"


def _text(value: float | list[float]) -> str:
    return ", ".join(f"{v:.6g}" for v in value) if isinstance(value, list) else f"{value:.6g}"
