"""The flags that commands share, and how those about the scene and the fit become the uppermost layer of settings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

from pipelines.told import numbers
from toolkit.errors import UsageError

if TYPE_CHECKING:
    from pipelines.layers import Layer
    from pipelines.settings import Settings

SCENE = Group.create_ordered("Scene")
FIT = Group.create_ordered("What to fit")
OUTPUT = Group.create_ordered("Output")
RUN = Group.create_ordered("Run")
Texts = tuple[str, ...]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class SceneFlags:
    """Where settings come from: presets < sidecar IMAGE.toml < --scene < the flags."""

    scene: Annotated[Path | None, Parameter(group=SCENE, metavar="FILE", help="Scene file (TOML).")] = None
    preset: Annotated[
        Texts, Parameter(group=SCENE, metavar="NAME", help="quick, standard or careful; repeatable, later ones win.")
    ] = ()
    light: Annotated[
        Texts,
        Parameter(
            group=SCENE,
            metavar="X,Y,Z",
            allow_leading_hyphen=True,
            help="Direction towards a far light: x right, y up, z to the camera. Repeatable. "
            "Without any the direction is estimated from the highlight.",
        ),
    ] = ()
    sphere: Annotated[
        str | None,
        Parameter(
            group=SCENE,
            metavar="CX,CY,R",
            allow_leading_hyphen=True,
            help="Where the sphere's centre projects and its radius, in pixels. Without it the sphere is detected.",
        ),
    ] = None
    pick: Annotated[
        str | None,
        Parameter(group=SCENE, metavar="X,Y", help="A place on the ball to detect, in pixels. [default: the largest]"),
    ] = None
    reference: Annotated[
        str | None,
        Parameter(
            group=SCENE,
            metavar="grey=R@X,Y,W,H[:FILE]",
            allow_leading_hyphen=True,
            help="A card of reflectance R at the rectangle X,Y,W,H (pixels) of the photograph, or of FILE, its own "
            "photograph in the ball's place: albedos become absolute. It faces the camera, or reference.normal.",
        ),
    ] = None
    chart: Annotated[
        Path | None,
        Parameter(
            group=SCENE,
            metavar="FILE",
            help="Photograph of a 24-patch colour chart in the same light, or the ball's own: sRGB by the chart "
            "instead of the file's matrices.",
        ),
    ] = None
    set: Annotated[
        Texts, Parameter(group=SCENE, metavar="TABLE.KEY=VALUE", help="Any setting of the scene file. Repeatable.")
    ] = ()
    seed: Annotated[int | None, Parameter(group=RUN, metavar="N", help="Same seed, same result. [default: 0]")] = None

    def layers(self) -> Iterator[Layer]:
        """Each flag as a layer of its own, so that an error names it."""
        from pipelines.layers import Layer, assignment

        if self.light:
            lights = [{"kind": "directional", "direction": numbers("--light", text, "X,Y,Z")} for text in self.light]
            yield Layer(name="--light", values={"light": lights})
        if self.sphere is not None:
            x, y, radius = numbers("--sphere", self.sphere, "CX,CY,R")
            yield Layer(name="--sphere", values={"sphere": {"centre_px": [x, y], "radius_px": radius}})
        if self.pick is not None:
            yield Layer(name="--pick", values={"image": {"pick_px": numbers("--pick", self.pick, "X,Y")}})
        if self.reference is not None:
            yield Layer(name="--reference", values={"reference": _reference(self.reference)})
        if self.chart is not None:
            yield Layer(name="--chart", values={"colour": {"chart": str(self.chart.absolute())}})
        if self.seed is not None:
            yield Layer(name="--seed", values={"fit": {"seed": self.seed}})
        yield from map(assignment, self.set)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FitFlags:
    """What is fitted."""

    model: Annotated[
        Texts,
        Parameter(
            group=FIT,
            metavar="NAME[:OPTION=CHOICE]",
            help="Specular lobe, as ggx or ggx:masking=smith; repeatable. `fit-material models` lists them. "
            "[default: torrance-sparrow, phong, blinn-phong, beckmann, ggx]",
        ),
    ] = ()
    diffuse: Annotated[
        Texts,
        Parameter(
            group=FIT,
            metavar="NAME",
            help="Diffuse lobe; repeatable. [default: lambert, and the best model over oren-nayar and wolff as well]",
        ),
    ] = ()
    specular: Annotated[
        Literal["neutral", "coloured"] | None,
        Parameter(group=FIT, help="Specular colour: one number, or one a channel. [default: coloured]"),
    ] = None
    fix: Annotated[
        Texts,
        Parameter(
            group=FIT,
            metavar="NAME",
            help="What is exactly known: light, distance, size, irradiance, returned, blur, centre, radius or all. "
            "Repeatable.",
        ),
    ] = ()
    discrepancy: Annotated[
        Literal["on", "off"] | None,
        Parameter(group=FIT, help="Allow for what the lobes miss on a real surface; off for renders. [default: on]"),
    ] = None
    method: Annotated[
        Literal["dichromatic", "none"] | None, Parameter(group=FIT, help="Separation by colour. [default: dichromatic]")
    ] = None
    illuminant: Annotated[
        str | None,
        Parameter(
            group=FIT, metavar="R,G,B", help="The light's colour in camera RGB, or auto: the surest way there is."
        ),
    ] = None
    transfer: Annotated[
        Literal["srgb"] | None, Parameter(group=FIT, help="Undo this curve in 8-bit or encoded images; marked.")
    ] = None

    def layers(self) -> Iterator[Layer]:
        """Each flag as a layer of its own, so that an error names it."""
        from pipelines.layers import Layer

        lists = {"model": "models", "diffuse": "diffuse", "fix": "fix"}
        for flag, key in lists.items():
            if getattr(self, flag):
                yield Layer(name=f"--{flag}", values={"fit": {key: list(getattr(self, flag))}})
        for flag in ("specular", "discrepancy"):
            if getattr(self, flag):
                yield Layer(name=f"--{flag}", values={"fit": {flag: getattr(self, flag)}})
        if self.transfer:
            yield Layer(name="--transfer", values={"image": {"transfer": self.transfer}})
        if self.method:
            yield Layer(name="--method", values={"separation": {"method": self.method}})
        if self.illuminant is not None:
            told = self.illuminant != "auto"
            colour = numbers("--illuminant", self.illuminant, "R,G,B") if told else None
            yield Layer(name="--illuminant", values={"separation": {"illuminant": colour}})


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class TalkFlags:
    """How a command talks."""

    quiet: Annotated[bool, Parameter(name=["--quiet", "-q"], group=OUTPUT, help="Errors and JSON only.")] = False
    verbose: Annotated[bool, Parameter(name=["--verbose", "-v"], group=OUTPUT, help="Tell of each stage.")] = False
    debug: Annotated[bool, Parameter(group=OUTPUT, help="Show the traceback of an error.")] = False


def _reference(text: str) -> dict[str, object]:
    """`grey=0.18@1200,800,150,150:card.dng` as the table; raises UsageError on another form."""
    stated, at, rest = text.partition("@")
    place, colon, file = rest.partition(":")
    name, equals, grey = stated.partition("=")
    if name != "grey" or not (equals and at and grey) or (colon and not file):
        raise UsageError(f"--reference: found {text!r}; expected grey=0.18@X,Y,W,H or grey=0.18@X,Y,W,H:card.dng")
    form = "R,G,B" if "," in grey else "R"
    reflectance = numbers("--reference", grey, form)
    box = [int(value) if value.is_integer() else value for value in numbers("--reference", place, "X,Y,W,H")]
    table: dict[str, object] = {"grey": reflectance if len(reflectance) == 3 else reflectance[0], "box_px": box}
    return {**table, "file": str(Path(file).absolute())} if file else table


def settings_for(image: Path | None, scene: SceneFlags, fit: FitFlags | None = None) -> Settings:
    """The settings of one image: all layers, the flags uppermost."""
    from pipelines.layers import resolve

    flags = [*scene.layers(), *(fit.layers() if fit else ())]
    return resolve(image, presets=scene.preset, scene=scene.scene, flags=flags)
