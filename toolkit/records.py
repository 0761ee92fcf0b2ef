"""The records that travel between the stages. Frozen; their arrays are read-only; nothing changes its input.

file -> RawFrame -> LinearImage -> Scene -> ColourLayers -> Fit -> Posterior -> MaterialReport.
Conventions: pixel x right, y down, the centre of the first pixel at (0, 0), after the EXIF orientation;
camera frame x right, y up, z towards the camera; channels 0, 1, 2 are red, green, blue of the camera.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
Projection = Literal["orthographic", "perspective"]


def readonly(record: object) -> None:
    """Set every array of a record read-only; called by each record's `__post_init__`."""
    for name in record.__slots__:  # type: ignore[attr-defined]  # every caller is a dataclass with slots
        value = getattr(record, name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Metadata:
    """What the file tells of its making; None where it says nothing. Text is untrusted."""

    make: str = ""
    model: str = ""
    lens: str = ""
    software: str = ""
    taken: str = ""
    exposure_s: float | None = None
    iso: float | None = None
    f_number: float | None = None
    focal_length_mm: float | None = None
    focal_length_35mm_mm: float | None = None
    focal_plane_resolution_px_per_mm: float | None = None
    noise_profile: tuple[tuple[float, float], ...] = ()  # DNG: variance = scale * signal + offset, signal in 0..1
    xyz_to_camera: tuple[tuple[float, float, float], ...] = ()  # DNG ColorMatrix1
    xyz_to_camera_2: tuple[tuple[float, float, float], ...] = ()  # DNG ColorMatrix2
    forward_matrix: tuple[tuple[float, float, float], ...] = ()  # DNG ForwardMatrix1: balanced camera to XYZ under D50
    forward_matrix_2: tuple[tuple[float, float, float], ...] = ()
    calibration_illuminants: tuple[int, ...] = ()  # EXIF LightSource of the first and the second matrix
    as_shot_neutral: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()  # what could not be read, and why


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RawFrame:
    """What a decoder gives: numbers as stored, oriented, nothing scaled.

    `values` is (H, W) uint16 for a mosaic, else (H, W, 3) uint8, uint16 or float32.
    `cfa` is the 2 x 2 table of channels at rows, columns (0, 0) .. (1, 1) of `values`; None where not a mosaic.
    `black` and `white` are 2 x 2 tables like `cfa` for a mosaic, else one number per channel; `white` is inf
    where the format has no ceiling (EXR, Radiance).
    """

    name: str
    sha256: str
    format: Literal["raw", "exr", "png", "tiff", "hdr", "image"]
    encoding: Literal["linear", "encoded"]  # "encoded": 8 bits, or the file names a transfer curve
    values: NDArray[Any]
    cfa: NDArray[np.uint8] | None = None
    black: Floats
    white: Floats
    metadata: Metadata = field(default_factory=Metadata)

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Noise:
    """Variance of a sample of channel c: gain[c] * signal + read[c]^2, in the image's units."""

    gain: Floats  # (3,)
    read: Floats  # (3,)
    source: Literal["given", "noise_profile", "estimated"]
    gain_sd: Floats | None = None  # (3,) standard errors, where estimated
    read_sd: Floats | None = None

    def __post_init__(self) -> None:
        readonly(self)

    def variance(self, signal: Floats, channel: int) -> Floats:
        """Variance at an expected signal (never at the noisy sample itself), same shape and kind as `signal`."""
        variance = np.maximum(signal, 0.0)
        variance *= float(self.gain[channel])
        variance += float(self.read[channel]) ** 2
        return np.asarray(variance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """Samples of one channel on a regular grid: sample (row, column) lies at origin_px + step_px * (column, row)."""

    channel: int
    values: NDArray[np.float32]  # (h, w), radiance in the image's units, unclipped below zero
    flags: NDArray[np.uint8]  # (h, w), SampleFlag
    origin_px: tuple[float, float]  # x, y
    step_px: int

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearImage:
    """A photograph as measurements: an RGB image is three planes of step 1, a Bayer frame four of step 2."""

    name: str
    sha256: str
    width_px: int
    height_px: int
    planes: tuple[Plane, ...]
    noise: Noise
    white: float  # the level at which samples clip, in the image's units; inf where there is none
    transfer_assumed: bool = False
    metadata: Metadata = field(default_factory=Metadata)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """The projection. `focal_length_px` and `principal_point_px` count only for "perspective"."""

    projection: Projection = "orthographic"
    focal_length_px: float | None = None
    principal_point_px: tuple[float, float] | None = None
    blur_px2: float = 0.0  # second moment, along each axis, of what lens and demosaicing spread a point of light over


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sphere:
    """A sphere's image: where its centre projects, and focal_length_px x tan(angular radius) (or the outline's)."""

    centre_px: tuple[float, float]
    radius_px: float
    covariance_px2: Floats  # (3, 3) of centre x, centre y, radius
    source: Literal["given", "detected"]
    given: Mapping[str, Any] | None = None  # what the user said, where detection refined it

    def __post_init__(self) -> None:
        readonly(self)


class Light(Protocol):
    """One kind of light; each lives in its own file of `toolkit.geometry.lights`."""

    @property
    def kind(self) -> str: ...  # its name in the scene file

    @property
    def angular_radius_deg(self) -> float: ...  # as seen from the sphere's centre

    @property
    def irradiance(self) -> tuple[float, float, float] | None: ...  # at the centre; None: not known

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector from the sphere's centre towards the light."""
        ...

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Unit directions towards the light (N, 3) and irradiance on a facing plane (N, 3) at `points`.

        `points` (N, 3) are in sphere radii from the sphere's centre, camera frame. Where no irradiance is given
        it is 1 in every channel at the sphere's centre.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Known geometry and light. `scale` is "relative" where no light has a known irradiance."""

    camera: Camera
    sphere: Sphere
    lights: tuple[Light, ...]
    light_source: Literal["given", "estimated"] = "given"
    scale: Literal["absolute", "relative"] = "relative"
    irradiance_covariance: Floats | None = None  # (3, 3), relative; None: exactly as given, or not known at all


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """A card of known reflectance and what it told: (3,) each; radiance and irradiance in the ball's image units."""

    grey: Floats
    box_px: tuple[int, int, int, int]
    file: str | None  # its own photograph; None: in the ball's
    sha256: str | None  # of its own photograph
    normal: tuple[float, float, float]
    radiance: Floats
    irradiance: Floats
    irradiance_sd: Floats

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraColour:
    """`to_srgb` (3, 3) takes reflectances in camera channels to linear sRGB; white, (1, 1, 1), stays white.

    `delta_e` is the mean CIEDE2000 of a chart's patches, each by the matrix of the others; None without a chart.
    """

    to_srgb: Floats
    source: Literal["forward-matrix", "colour-matrix", "chart"]
    delta_e: float | None = None
    white: Floats | None = None  # (3,) the light's colour that the chart's greys show, radiance of a perfect white
    chart_sha256: str | None = None  # of the chart's photograph

    def __post_init__(self) -> None:
        readonly(self)


def scale_of(scenes: Sequence[Scene]) -> Literal["absolute", "relative"]:
    """The scale of what several photographs say together: absolute where one of them is."""
    return "absolute" if any(scene.scale == "absolute" for scene in scenes) else "relative"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ColourLayers:
    """What colour alone separates, on the sphere's box of quads (a mosaic's 2 x 2) or pixels.

    A pixel is `along_body` times the body's colour and `along_light` times the light's, (h, w) radiance, NaN off the
    sphere; `origin_px` and `step_px` place them as in Plane. `covariance` is that of these two coefficients: (h, w, 3)
    as var, cov, var.
    """

    method: str
    body_colour: Floats  # (3,), unit norm
    light_colour: Floats  # (3,), unit norm
    body_covariance: Floats  # (3, 3)
    light_covariance: Floats  # (3, 3)
    light_source: str  # where the light's colour comes from
    angle_deg: float
    angle_sd_deg: float
    cluster: Literal["point", "line", "plane", "volume"]
    along_body: Floats
    along_light: Floats
    covariance: Floats
    residual: Floats  # (h, w), signed distance from the plane of the two colours, radiance
    corner: Floats  # (3,) radiance where the highlight leaves the matte line; NaN where no highlight is seen
    highlight_colour: Floats  # (3,) unit direction of the highlight's cluster as seen; NaN where none is
    origin_px: tuple[float, float]
    step_px: int
    flags: tuple[str, ...] = ()
    light_reason: str = ""  # in words, why that source of the light's colour

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def diffuse(self) -> Floats:
        """The body's layer (h, w, 3), radiance; made each time it is asked for, as the light's is."""
        return _coloured(self.along_body, self.body_colour)

    @property
    def specular(self) -> Floats:
        """The light's layer (h, w, 3)."""
        return _coloured(self.along_light, self.light_colour)


def _coloured(along: Floats, colour: Floats) -> Floats:
    """A coefficient (h, w) in a colour: (h, w, 3), each channel together in memory."""
    return _made(np.moveaxis(np.multiply.outer(colour.astype(along.dtype), along), 0, -1))


def _made(values: Floats) -> Floats:
    """An array that a record makes when asked, read-only as those that it holds."""
    values.setflags(write=False)
    return values


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """One parameter of a fit; colour parameters carry (3,) arrays, intervals are (low, high). None: not available."""

    name: str
    unit: str
    estimate: float | Floats | None  # posterior mean
    mode: float | Floats | None
    sd: float | Floats | None
    sd_statistical: float | Floats | None
    interval_68: tuple[Any, Any] | None
    interval_90: tuple[Any, Any] | None
    posterior_to_prior: float | Floats | None
    note: str = ""  # in words, why a parameter is not identified
    flags: tuple[str, ...] = ()  # of `Flag`: what a reader must know of this one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnostics:
    """How well a posterior was sampled."""

    samples: int
    ess_min: float
    r_hat_max: float
    tau_max: float
    acceptance: float
    seed: int
    quadrature_error: float | None = None  # of one shape number's mean or sd, in sds, against the sum over a grid


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """One model fitted to one photograph, or to several of one material: then `scene` is the first one's.

    `shape` holds the non-linear numbers at the mode by name, `colours` the linear ones by name, (3,) each:
    "diffuse_albedo", "reflectance_factor", "pedestal", and "specular_albedo", or "specular_strength" and "specular_f0".
    `draws` are posterior draws by parameter name, (chains, draws) or (chains, draws, 3).
    """

    model: str
    variant: Mapping[str, str]
    diffuse: str
    status: str  # "converged", or the reason why not, as a message
    flags: tuple[str, ...]
    shape: Mapping[str, float]
    colours: Mapping[str, Floats]
    chi2_reduced: float
    elpd: float
    elpd_blocks: Floats  # (blocks,), summing to elpd
    parameters: tuple[Estimate, ...]
    diagnostics: Diagnostics | None
    draws: Mapping[str, Floats]
    scene: Scene  # the geometry at the optimum, with fitted nuisances
    nuisances: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # shift and its sd, by name with unit
    bic: float = float("nan")  # Schwarz's criterion over the cells' means; smaller is better
    tempering: float = 1.0  # how many times less than by their noise the data weighed, for what the model gets wrong
    others: tuple[Scene, ...] = ()  # of a joint fit, the other photographs' geometry; their own numbers are "_2", ...

    @property
    def scale(self) -> Literal["absolute", "relative"]:
        """Of the albedos."""
        return scale_of([self.scene, *self.others])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModelLayers:
    """The best fit's own pictures on the sphere's box; (h, w, 3) radiance, NaN off the sphere.

    diffuse + specular + pedestal = model; residual = photograph - model.
    """

    photograph: Floats
    diffuse: Floats
    specular: Floats
    used: NDArray[np.bool_]  # (h, w, 3): on the sphere and not flagged; a fit uses those that are lit and off the limb
    pedestal: Floats  # (3,)
    origin_px: tuple[float, float]
    step_px: int

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def model(self) -> Floats:
        """What the fit says of the photograph; made each time it is asked for, as the residual is."""
        both = self.diffuse + self.specular
        both += self.pedestal.astype(both.dtype)
        return _made(both)

    @property
    def residual(self) -> Floats:
        """What the fit leaves of it."""
        return _made(self.photograph - self.model)

    def lines(self, rows: slice) -> ModelLayers:
        """Some lines of them: what is made of few is made in the processor's cache."""
        x, y = self.origin_px
        return replace(
            self,
            photograph=self.photograph[rows],
            diffuse=self.diffuse[rows],
            specular=self.specular[rows],
            used=self.used[rows],
            origin_px=(x, y + self.step_px * rows.indices(len(self.used))[0]),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Agreement:
    """Layers by colour beside layers by shape: which to believe, why, and how far they are apart.

    `difference` is the relative rms of the specular layers' difference beyond noise; None where colour says nothing.
    """

    preferred: Literal["shape", "colour"]
    reason: str
    difference: float | None
    disagree: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Photograph:
    """One photograph with what is its own: where it was taken; after the fit also what colour separates and the best
    fit's layers, and which of them to believe.
    """

    image: LinearImage
    scene: Scene
    flags: tuple[str, ...]
    separation: ColourLayers | None = None
    layers: ModelLayers | None = None
    agreement: Agreement | None = None  # None where separation by colour was not asked for
    reference: Reference | None = None
    colour: CameraColour | None = None  # None: the camera's colours are not known


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MaterialReport:
    """Everything the outputs are made from; of several photographs fitted jointly, image to layers are the first's."""

    schema: ClassVar[str] = "fit-material/1"

    image: LinearImage
    scene: Scene
    separation: ColourLayers | None
    agreement: Agreement | None  # None where separation by colour was not asked for
    fits: tuple[Fit, ...]
    best: int
    preferred: int | None
    elpd_difference: tuple[float, float] | None  # best minus runner-up, and its sd
    layers: ModelLayers | None
    flags: tuple[str, ...]
    seconds: Mapping[str, float]  # by stage
    reference: Reference | None = None
    colour: CameraColour | None = None  # None: the camera's colours are not known
    photographs: tuple[Photograph, ...] = ()  # all of a joint fit, in order; empty where there is one

    @property
    def scale(self) -> Literal["absolute", "relative"]:
        """Of the albedos."""
        return scale_of([self.scene, *(one.scene for one in self.photographs)])
