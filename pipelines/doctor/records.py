"""What an examination finds. Frozen; None where it could not be found."""

from __future__ import annotations

from dataclasses import dataclass

from toolkit.errors import FitMaterialError
from toolkit.records import Floats, LinearImage, RawFrame, Scene, readonly

Pixel = tuple[float, float]
Direction = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Exposure:
    """How the ball, or where there is none the frame, fills the range; (3,) by channel, image units.

    `body` is the median of what is lit, `peak` the brightest, hot pixels left out, `snr` that of one sample at
    `body`; `lost_stops` how far the brightest lies above white, as what is not clipped tells, None where nothing is;
    `lost_at_least` where it may be much more.
    """

    of: str  # "ball" or "frame"
    clipped_share: Floats
    body: Floats
    peak: Floats
    snr: Floats
    headroom_stops: Floats | None  # from peak to white; None where the format has no ceiling
    lost_stops: float | None
    lost_at_least: bool

    def __post_init__(self) -> None:
        readonly(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surroundings:
    """The ball in its frame: its outline's least distance from the frame's edge, and what is bright around it.

    Shares of the body's median: the median just outside the outline, and that of the ball's unlit side.
    """

    frame_share: float  # diameter over the frame's shorter side
    margin_px: float
    background_share: float | None
    shadow_share: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lamp:
    """The light, and the highlight where it is expected and where it is seen.

    `shown` is what the ball itself says: a given light is held against its shading and highlight together, an
    estimated one, which comes from these, against the mirrored view at the highlight's middle.
    """

    direction: Direction
    sd_deg: float | None
    source: str  # "given" or "estimated"
    off_axis_deg: float  # from the line between ball and camera
    expected_px: Pixel | None
    seen_px: Pixel | None
    shown: Direction | None
    apart_deg: float | None  # between that and the light
    tolerance_deg: float  # what it may be, three sds
    instead: Direction | None  # the light with its axes otherwise, which would fit

    @property
    def doubted(self) -> bool:
        """Whether the ball shows another light."""
        return self.apart_deg is not None and self.apart_deg > self.tolerance_deg


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """One thing to change in the next photograph, and why; serious where a fit would suffer from it."""

    do: str
    because: str
    serious: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Examination:
    """Everything found; `error` is what a fit would stop at."""

    frame: RawFrame
    image: LinearImage | None  # the ball's box, or the whole frame where there is no ball
    scene: Scene | None
    noise_sd: tuple[Floats, Floats] | None  # of an estimated gain and read noise
    exposure: Exposure | None
    surroundings: Surroundings | None
    lamp: Lamp | None
    flags: tuple[str, ...]
    advice: tuple[Advice, ...]
    error: FitMaterialError | None
