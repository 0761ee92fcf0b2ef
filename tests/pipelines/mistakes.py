"""Every mistake a user makes with a photograph or its scene: what is typed, the exit code, the one line that answers.

`MISTAKES` is the table; `make_folder` makes the files that its commands name. In a line `*` stands for what differs.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.io import good

SCENE = """
[image]
width_px = 160
height_px = 128
background = 0.01
[material]
model = "phong"
diffuse = "lambert"
[material.parameters]
shininess = 60
diffuse_albedo = [0.5, 0.25, 0.12]
specular_albedo = 0.1
[sphere]
centre_px = [82.3, 63.2]
radius_px = 48.0
[[light]]
kind = "directional"
direction = [-0.4, 0.4, 0.82]
irradiance = [3.0, 3.0, 3.0]
[noise]
gain = 5e-5
read = 2e-4
"""
SPHERE, LIGHT = "82.3,63.2,48", "-0.4,0.4,0.82"


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A mistake in words, the command after `fit-material`, its exit code and the line it prints."""

    what: str
    words: str
    code: int
    line: str


def _render(folder: Path, name: str, *changes: str) -> None:
    """A photograph of the scene with some of it changed, and no scene file beside it."""
    from pipelines.cli import main

    (folder / "scene.toml").write_text(SCENE)
    words = [word for change in changes for word in ("--set", change)]
    assert main(["render", str(folder / "scene.toml"), "--out", str(folder / name), *words]) == 0
    (folder / f"{name}.toml").unlink()


def _images(folder: Path) -> None:
    _render(folder, "ball.dng")
    _render(folder, "dark.dng", "image.exposure=1e-5")
    _render(folder, "bright.dng", "image.exposure=1e6", "image.background=0.0")
    _render(folder, "white.dng", "image.exposure=1e6", "image.pedestal=0.1")
    _render(folder, "cut.dng", "sphere.centre_px=[20, 63]")
    _render(folder, "behind.dng", "light.0.direction=[0.5, 0.0, -0.87]", "sphere.radius_px=14.0")
    _render(folder, "ball.png")
    whole = (folder / "ball.dng").read_bytes()
    (folder / "short.dng").write_bytes(whole[: len(whole) // 2])
    rng = np.random.default_rng(0)
    good.dng(folder / "noball.dng", (600 + rng.normal(0, 20, (128, 160))).astype(np.uint16))
    good.png(folder / "grey.png", np.arange(48 * 64, dtype=np.uint16).reshape(48, 64))
    red = (good.picture() * 60_000).astype(np.uint16)
    red[..., 1:] = 0
    good.png(folder / "red.png", red)
    good.png(folder / "eight.png", (good.picture() * 255).astype(np.uint8))
    good.dng(folder / "zeros.dng", np.zeros((48, 64), np.uint16))
    good.dng(folder / "garbage.dng", rng.integers(0, 16_000, (48, 64)).astype(np.uint16))
    nan = {name: np.full((48, 64), np.nan, np.float32) for name in "RGB"}
    for plane in nan.values():
        plane[:4] = [[0.0, 1.0] * 32] * 4
    good.exr(folder / "nan.exr", channels=nan)


def _others(folder: Path) -> None:
    (folder / "folder").mkdir()
    (folder / "text.dng").write_text("a shopping list: eggs, milk, one white billiard ball\n")
    (folder / "empty.dng").touch()
    (folder / "broken.dng").symlink_to("nowhere.dng")
    os.mkfifo(folder / "pipe.dng")
    (folder / "batch").write_bytes((folder / "ball.dng").read_bytes())
    (folder / "done.fit").mkdir()
    (folder / "done.fit" / "ball.json").write_text("{}")
    (folder / "file").write_text("")
    for name, text in SCENES.items():
        (folder / f"{name}.toml").write_text(text)


SCENES = {
    "unknown": "[sphere]\ncenter_px = [82.3, 63.2]\nradius_px = 48.0\n",
    "table": "[lens]\nmm = 50\n",
    "nan": "[sphere]\ncentre_px = [nan, 63.2]\nradius_px = 48.0\n",
    "negative": "[sphere]\ncentre_px = [82.3, 63.2]\nradius_px = -48.0\n",
    "zero": "[[light]]\nkind = 'directional'\ndirection = [0, 0, 0]\n",
    "number": "[noise]\ngain = 'little'\nread = 1e-3\n",
    "kind": "[[light]]\nkind = 'sun'\ndirection = [0, 0, 1]\n",
    "syntax": "[sphere\n",
    "infinite": "[camera]\nfocal_length_px = inf\n",
    "telephoto": "[camera]\nprojection = 'perspective'\n",
    "far": "[sphere]\ncentre_px = [1e12, 63.2]\nradius_px = 48.0\n",
    "huge": "[sphere]\ncentre_px = [82.3, 63.2]\nradius_px = 1e300\n",
}


def make_folder(folder: Path) -> None:
    """All files that the table's commands name."""
    _images(folder)
    _others(folder)


def _known(sphere: str = SPHERE, light: str = LIGHT) -> str:
    return f"--sphere {sphere} --light={light}"


IMAGE = "expected an image file"
NO_DEVICE = "a device or pipe, not a regular file; copy the photograph to a file first"
TOML = "expected a scene file in TOML"
SCENE_LINE = "expected --light towards the lamp (x right, y up, z to the camera) and --sphere around the ball"

MISTAKES = tuple(
    Mistake(what=what, words=words, code=code, line=line)
    for what, words, code, line in (
        # the file
        ("missing file", "none.dng", 3, f"none.dng does not exist; {IMAGE}"),
        ("folder", "folder", 3, f"folder is a folder; {IMAGE}, or for a whole folder fit-material batch"),
        ("link to nothing", "broken.dng", 3, f"broken.dng is a link to nowhere.dng, which does not exist; {IMAGE}"),
        ("a name longer than any", "x" * 300, 3, f"xxx* cannot be reached: File name too long; {IMAGE}"),
        ("pipe", "pipe.dng", 3, f"pipe.dng: {NO_DEVICE}"),
        ("device", "/dev/zero", 3, f"/dev/zero: {NO_DEVICE}"),
        ("empty file", "empty.dng", 3, "empty.dng: an empty file; copy it from the camera again"),
        (
            "text named .dng",
            "text.dng",
            3,
            "text.dng: a text file named .dng; expected a camera raw, OpenEXR, 16-bit PNG or TIFF, or Radiance .hdr",
        ),
        (
            "truncated raw",
            "short.dng",
            3,
            "short.dng: the raw ends before its pixels do; it is cut short: copy it from the camera again",
        ),
        (
            "raw of zeros",
            "zeros.dng",
            3,
            "zeros.dng: it decodes to nothing: every sample is the same; copy it from the camera again",
        ),
        (
            "raw of garbage",
            "garbage.dng",
            3,
            "garbage.dng: its neighbouring samples are unrelated (correlation *); it decodes to garbage: "
            "export it as DNG, or 16-bit TIFF",
        ),
        ("one channel", "grey.png", 3, "grey.png: an image with one channel; three colours are needed"),
        (
            "one channel of three",
            "red.png",
            3,
            "red.png: one of its channels is the same everywhere; three colours are needed: use a colour camera",
        ),
        (
            "8 bits",
            "eight.png",
            2,
            "eight.png: the image is 8-bit or names a transfer curve; linear radiance is needed: "
            "pass a raw, EXR or 16-bit linear file, or --transfer srgb to assume the sRGB curve",
        ),
        # the photograph
        ("no sphere", "noball.dng", 3, "noball.dng: no sphere found*; expected a*ball*give --sphere CX,CY,R"),
        ("hardly a number in it", "nan.exr", 3, "nan.exr: no sphere found*expected a*give --sphere CX,CY,R"),
        (
            "sphere cut by the frame",
            "cut.dng",
            3,
            "cut.dng: the sphere at (*, *) with radius * px is cut by the frame; "
            "expected a whole ball: photograph it from further away",
        ),
        (
            "sphere cut by the frame, as told",
            f"cut.dng {_known('20,63,48')}",
            3,
            "cut.dng: the frame cuts the sphere: it reaches 28 px beyond the left edge; "
            "expected a whole ball: photograph it from further away, or correct --sphere",
        ),
        (
            "sphere outside the frame",
            f"ball.dng {_known('400,63,48')}",
            3,
            "ball.dng: the sphere's centre (400, 63) lies outside the 160 x 128 frame; "
            "expected pixel coordinates, x right and y down from the first pixel",
        ),
        (
            "sphere too small",
            f"ball.dng {_known('82,63,4')}",
            3,
            "ball.dng: sphere.radius_px is 4; expected 12 px or more: photograph it larger",
        ),
        (
            "light behind the sphere",
            f"ball.dng {_known(light='0,0,-1')}",
            3,
            "ball.dng: the light 0.00,0.00,-1.00 stands behind the sphere and lights its far side; "
            "expected a direction towards the light: x right, y up, z towards the camera",
        ),
        (
            "light on the wrong side",
            f"ball.dng {_known(light='0.4,-0.4,0.82')}",
            3,
            "ball.dng: light from 0.40,-0.40,0.82 explains * % of the sphere's shading, "
            f"light from -0.4*,0.*,0.8* would explain 9* %; {SCENE_LINE}",
        ),
        (
            "highlight outside the sphere",
            f"ball.dng {_known('90,85,40')}",
            3,
            "ball.dng: light from -0.40,0.40,0.82 explains * % of the sphere's shading, "
            f"light from * would explain * %; {SCENE_LINE}",
        ),
        (
            "nothing lit",
            f"behind.dng {_known('82.3,63.2,14', '0.5,0,-0.87')}",
            3,
            "behind.dng: only * lit places of the sphere can be used, expected 60 or more: "
            "check the light's direction and the sphere, or photograph the sphere larger",
        ),
        (
            "all clipped",
            "white.dng",
            3,
            "white.dng: every sample is at 65000, its white level; "
            "expected a photograph not all clipped: expose shorter",
        ),
        (
            "ball clipped",
            "bright.dng",
            3,
            "bright.dng: no sphere found, and * % of the samples are clipped; "
            "expected a ball whose outline and shading can be seen: expose shorter, or give --sphere CX,CY,R",
        ),
        (
            "ball clipped, sphere told",
            f"bright.dng {_known()}",
            3,
            "bright.dng: almost every sample of the sphere is clipped; "
            "expected an exposure that keeps most of the sphere below white: shorten the exposure",
        ),
        (
            "all dark",
            "dark.dng",
            3,
            "dark.dng: no sphere found, and the photograph is dark: its brightest part is at 0.0* % of white; "
            "expected a lit ball: expose longer, check lamp and lens cap, or give --sphere CX,CY,R",
        ),
        (
            "all dark, sphere told",
            f"dark.dng {_known()}",
            3,
            "dark.dng: the sphere is dark: its brightest and darkest parts differ by 0.00*, one sample's noise is "
            "0.0002; expected a lit ball: expose longer, check lamp and lens cap",
        ),
        # the scene
        (
            "unknown key",
            "ball.dng --scene unknown.toml",
            3,
            "ball.dng: unknown.toml: unknown key sphere.center_px; did you mean centre_px?",
        ),
        (
            "unknown table",
            "ball.dng --scene table.toml",
            3,
            "ball.dng: table.toml: unknown key lens; known here: camera, sphere, light, *",
        ),
        (
            "NaN",
            "ball.dng --scene nan.toml",
            3,
            "ball.dng: nan.toml: sphere.centre_px.0 is NaN; expected a finite number",
        ),
        (
            "infinity",
            "ball.dng --scene infinite.toml",
            3,
            "ball.dng: infinite.toml: camera.focal_length_px is Infinity; expected a finite number",
        ),
        (
            "negative radius",
            "ball.dng --scene negative.toml",
            3,
            "ball.dng: negative.toml: sphere.radius_px is -48.0; expected a number > 0",
        ),
        (
            "light from nowhere",
            "ball.dng --scene zero.toml",
            3,
            "ball.dng: zero.toml: light.0: light direction [0.0, 0.0, 0.0] has no length; "
            "expected a vector towards the light",
        ),
        (
            "text for a number",
            "ball.dng --scene number.toml",
            3,
            'ball.dng: number.toml: noise.gain is "little"; expected a number, or three',
        ),
        (
            "unknown kind of light",
            "ball.dng --scene kind.toml",
            3,
            "ball.dng: kind.toml: light.0.kind is \"sun\"; expected one of 'directional', 'point'*",
        ),
        ("no TOML", "ball.dng --scene syntax.toml", 3, f"ball.dng: syntax.toml: Expected ']'*(at line 1, *); {TOML}"),
        ("scene missing", "ball.dng --scene none.toml", 3, f"*none.toml: cannot be read: No such file*; {TOML}"),
        ("scene is a folder", "ball.dng --scene folder", 3, f"ball.dng: folder: a folder; {TOML}"),
        ("scene is a pipe", "ball.dng --scene pipe.dng", 3, f"ball.dng: pipe.dng: a device or pipe; {TOML}"),
        ("scene is a photograph", "ball.dng --scene short.dng", 3, f"*short.dng: not text in UTF-8; {TOML}"),
        (
            "centre far away",
            "ball.dng --scene far.toml",
            3,
            "ball.dng: the sphere's centre (1e+12, 63.2) lies outside the 160 x 128 frame; expected pixel *",
        ),
        (
            "radius beyond measure",
            "ball.dng --scene huge.toml",
            3,
            "*huge.toml: sphere.radius_px is 1e+300; expected a number <= 1e+12",
        ),
        (
            "perspective without a focal length",
            "ball.png --scene telephoto.toml",
            3,
            "ball.png: camera.projection is perspective but neither settings nor EXIF tell the focal length; "
            "expected camera.focal_length_px",
        ),
        # the results
        (
            "output exists",
            "ball.dng --out done.fit",
            2,
            f"ball.dng: {Path('done.fit/ball.json')} exists; "
            "expected a new place: --out DIR, or --overwrite, or --resume",
        ),
        (
            "output is a file",
            "ball.dng --out file",
            2,
            "ball.dng: file is a file; expected a folder for the results: *",
        ),
        ("output in a file", "ball.dng --out file/deep", 2, "ball.dng: file is a file; expected a folder for the *"),
        # the words
        ("a command's name", "--json batch", 2, "'batch' is a command's name and comes first; * write ./batch"),
    )
)
