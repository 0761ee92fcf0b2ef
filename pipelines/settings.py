"""The scene file and every option of a run as one strict record: no unknown keys, no NaN, nothing implied.

`Settings` is complete: written as TOML beside a result (`dumps`) and read back identically. `pipelines.layers`
merges it from defaults, presets, sidecar, scene file and flags. Functions below turn its tables into the
records of the toolkit.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from toolkit.geometry.lights import AnyLight
from toolkit.geometry.lights.base import LARGEST, Number, Positive
from toolkit.records import Camera, Metadata, Noise, Projection, Sphere

DEFAULT_MODELS = ("torrance-sparrow", "phong", "blinn-phong", "beckmann", "ggx")
DEFAULT_SPHERE_SD_PX = 0.5  # how well a given centre and radius are known where nothing is said
DEFAULT_GREY_SD = 0.03  # relative, of a card's reflectance: what good cards state
FULL_FRAME_DIAGONAL_MM = 43.27  # 24 mm x 36 mm: what "35 mm equivalent" refers to (CIPA DC-008)


def _three(value: object) -> tuple[object, ...]:
    """One number stands for the same in all three channels."""
    if isinstance(value, (list, tuple)):
        return tuple(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return (value,) * 3
    raise ValueError("expected a number, or three")


def _direction(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("expected a direction, not all 0")
    return value


def _known_lobe(kind: Literal["diffuse", "specular"]) -> AfterValidator:
    def check(name: str) -> str:
        from toolkit.reflectance import LOBES

        model, _ = model_and_variant(name)
        choices = [lobe.name for lobe in LOBES.values() if lobe.kind == kind]
        if model not in choices:
            raise ValueError(f"{model!r} is no {kind} model; expected one of {', '.join(choices)}")
        LOBES[model].complete(model_and_variant(name)[1])
        return name

    return AfterValidator(check)


Pair = tuple[Number, Number]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Share = Annotated[float, Field(gt=0, le=1)]
PositiveColour = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_three)]
Colour = Annotated[tuple[NotNegative, NotNegative, NotNegative], BeforeValidator(_three)]
Reflectance = Annotated[tuple[Share, Share, Share], BeforeValidator(_three)]
Pixels = Annotated[int, Field(ge=16, le=65535)]
SpecularModel = Annotated[str, Field(min_length=1, max_length=80), _known_lobe("specular")]
DiffuseModel = Annotated[str, Field(min_length=1, max_length=80), _known_lobe("diffuse")]
Nuisance = Literal["light", "distance", "size", "irradiance", "returned", "blur", "centre", "radius", "all"]


class Table(BaseModel):
    """Base of the tables: frozen, no unknown keys, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class CameraTable(Table):
    """What is omitted is found: the focal length from the EXIF, the principal point in the frame's middle."""

    projection: Projection | None = None  # omitted: perspective where a focal length is known
    focal_length_px: Positive | None = None
    principal_point_px: Pair | None = None


class SphereTable(Table):
    """Where the sphere's centre projects and how large it is; the whole table omitted: detected."""

    centre_px: Pair
    radius_px: Positive
    centre_sd_px: NotNegative | None = None
    radius_sd_px: NotNegative | None = None


class NoiseTable(Table):
    """Variance = gain x signal + read^2, image units; one number, or one a channel."""

    gain: Colour
    read: PositiveColour


class ImageTable(Table):
    """How the file is read, which ball in it is meant, the lens; all else is for `render`, which writes it."""

    transfer: Literal["srgb"] | None = None  # the curve to undo in 8-bit or encoded files
    pick_px: Pair | None = None  # a place on the ball to detect, where there are several; omitted: the largest
    width_px: Pixels | None = None
    height_px: Pixels | None = None
    format: Literal["dng", "exr", "png"] | None = None  # omitted: from the output's name
    exposure: Positive | None = None  # image units per radiance; omitted: the highlight at 0.8 of saturation
    background: Colour = (0.0, 0.0, 0.0)  # radiance around the sphere
    pedestal: Colour = (0.0, 0.0, 0.0)  # radiance added everywhere: stray light
    blur_sd_px: NotNegative = 0.0  # of the lens, in either direction


class MaterialTable(Table):
    """What `render` makes the sphere of; a fit never looks at it."""

    model: SpecularModel = "torrance-sparrow"
    diffuse: DiffuseModel = "lambert"
    parameters: dict[str, float | tuple[float, float, float]] = Field(default_factory=dict, max_length=32)


class SeparationTable(Table):
    """Separation by colour alone."""

    method: Literal["dichromatic", "none"] = "dichromatic"
    illuminant: PositiveColour | None = None  # the light's colour in camera RGB; omitted: found


class ReferenceTable(Table):
    """A card of known reflectance, in the ball's photograph or in one of its own: turns relative into absolute."""

    grey: Reflectance
    grey_sd: NotNegative | None = None  # of the stated reflectance; omitted: 3 % of it
    box_px: tuple[int, int, Annotated[int, Field(gt=0)], Annotated[int, Field(gt=0)]]  # x, y, width, height
    file: Annotated[str, Field(min_length=1, max_length=4096)] | None = None  # beside the photograph, or a full path
    normal: Annotated[tuple[float, float, float], AfterValidator(_direction)] = (0.0, 0.0, 1.0)
    normal_sd_deg: NotNegative = 2.0

    @property
    def relative_sd(self) -> float:
        """Relative sd of the stated reflectance."""
        return DEFAULT_GREY_SD if self.grey_sd is None else self.grey_sd / (sum(self.grey) / 3)


class ColourTable(Table):
    """How the camera's colours become sRGB: by a chart, else by the file's own matrices."""

    chart: Annotated[str, Field(min_length=1, max_length=4096)] | None = None  # its photograph; may be the ball's


class FitTable(Table):
    """What is fitted, what is taken as exactly known, and how long the posterior is sampled."""

    models: Annotated[tuple[SpecularModel, ...], Field(min_length=1, max_length=64)] = DEFAULT_MODELS
    diffuse: Annotated[tuple[DiffuseModel, ...], Field(max_length=16)] = ()  # none: lambert, the best over all
    specular: Literal["neutral", "coloured"] = "coloured"
    fix: Annotated[tuple[Nuisance, ...], Field(max_length=16)] = ()
    discrepancy: Literal["on", "off"] = "on"  # "off": the model is taken as exactly right, as for renders
    ess: Annotated[int, Field(ge=100, le=1_000_000)] = 4000  # effective samples to reach
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0


class Settings(Table):
    """One run, complete. Tables that are None are found from the image or its EXIF."""

    camera: CameraTable | None = None
    sphere: SphereTable | None = None
    light: Annotated[tuple[AnyLight, ...], Field(max_length=64)] = ()
    noise: NoiseTable | None = None
    image: ImageTable = ImageTable()
    material: MaterialTable | None = None
    reference: ReferenceTable | None = None
    colour: ColourTable = ColourTable()
    separation: SeparationTable = SeparationTable()
    fit: FitTable = FitTable()


def dumps(settings: Settings) -> str:
    """The settings as TOML that reads back identically."""
    import tomli_w

    return tomli_w.dumps(settings.model_dump(exclude_none=True))


def model_and_variant(text: str) -> tuple[str, dict[str, str]]:
    """`ggx:masking=smith` as ("ggx", {"masking": "smith"}); raises ValueError on another form."""
    name, *options = text.split(":")
    pairs = [option.split("=") for option in options]
    if any(len(pair) != 2 or not all(pair) for pair in pairs):
        raise ValueError(f"{text!r} cannot be read; expected NAME or NAME:OPTION=CHOICE, as in ggx:masking=smith")
    return name, {pair[0]: pair[1] for pair in pairs}


def camera_of(settings: Settings, *, width_px: int, height_px: int, metadata: Metadata | None = None) -> Camera:
    """The camera, completed from the frame's size and the EXIF; orthographic where no focal length is known."""
    table, blur_px2 = settings.camera or CameraTable(), settings.image.blur_sd_px**2
    focal_px = table.focal_length_px or _exif_focal_length_px(metadata or Metadata(), width_px, height_px)
    if table.projection == "orthographic" or focal_px is None:
        _refuse_perspective_without_focal_length(table)
        return Camera(blur_px2=blur_px2)
    middle = ((width_px - 1) / 2, (height_px - 1) / 2)
    return Camera(
        projection="perspective",
        focal_length_px=focal_px,
        principal_point_px=table.principal_point_px or middle,
        blur_px2=blur_px2,
    )


def _refuse_perspective_without_focal_length(table: CameraTable) -> None:
    if table.projection == "perspective":
        from toolkit.errors import BadInputError

        raise BadInputError(
            "camera.projection is perspective but neither settings nor EXIF tell the focal length; "
            "expected camera.focal_length_px"
        )


def _exif_focal_length_px(metadata: Metadata, width_px: int, height_px: int) -> float | None:
    if metadata.focal_length_mm and metadata.focal_plane_resolution_px_per_mm:
        return metadata.focal_length_mm * metadata.focal_plane_resolution_px_per_mm
    if metadata.focal_length_35mm_mm:
        return metadata.focal_length_35mm_mm * float(np.hypot(width_px, height_px)) / FULL_FRAME_DIAGONAL_MM
    return None


def sphere_of(settings: Settings) -> Sphere | None:
    """The sphere as given, its covariance from the given or default sds; None where it is to be detected.

    Raises UsageError where it is given and a ball to detect is picked as well.
    """
    table = settings.sphere
    if table is None:
        return None
    if settings.image.pick_px is not None:
        from toolkit.errors import UsageError

        raise UsageError(
            "found both a sphere and image.pick_px (--pick), which says what ball to detect; expected one of them"
        )
    centre_sd_px = DEFAULT_SPHERE_SD_PX if table.centre_sd_px is None else table.centre_sd_px
    radius_sd_px = DEFAULT_SPHERE_SD_PX if table.radius_sd_px is None else table.radius_sd_px
    covariance = np.diag(np.square([centre_sd_px, centre_sd_px, radius_sd_px]))
    return Sphere(
        centre_px=table.centre_px, radius_px=table.radius_px, covariance_px2=covariance, source="given", given=None
    )


def lights_of(settings: Settings) -> tuple[AnyLight, ...]:
    """The lights as given; empty where the direction is to be estimated from the highlight."""
    return settings.light


def noise_of_settings(settings: Settings) -> Noise | None:
    """The noise as given; None where it comes from the DNG's NoiseProfile or from the image itself."""
    table = settings.noise
    if table is None:
        return None
    return Noise(gain=np.array(table.gain), read=np.array(table.read), source="given")
