"""The light's colour: every way to know it, ranked by reliability, each with its error.

| source | needs | error |
|---|---|---|
| given | the user, or a light of known irradiance | as given |
| grey card | a neutral surface in the same light | the card's own, about 0.5 degrees |
| planes | two or more bodies of different hue with highlights | from the noise of both planes |
| highlight line, inverse intensity | one body with a highlight | whichever states the smaller error |
| camera | the camera's own white balance | 6 degrees |
| assumed | nothing: equal numbers in all channels | 15 degrees |

The residual of the known shape, which is better than all that colour alone can tell, belongs to the fit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Floats, Noise, readonly

from .samples import Mask, Samples, samples

Source = Literal["given", "card", "planes", "shape", "highlight-line", "inverse-intensity", "camera", "assumed"]
RANK: tuple[Source, ...] = (
    "given", "card", "planes", "shape", "highlight-line", "inverse-intensity", "camera", "assumed"
)  # fmt: skip
ALIKE = ("highlight-line", "inverse-intensity")  # of equal rank: the smaller stated error wins
CAMERA_SD_DEG = 6.0
ASSUMED_SD_DEG = 15.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Illuminant:
    """The light's unit colour (3,) in camera RGB, its covariance (3, 3), its source and why that was chosen."""

    colour: Floats
    covariance: Floats
    source: Source
    reason: str = ""

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def sd_deg(self) -> float:
        """Expected angle between this and the true colour, rms, degrees."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance))))


def illuminant(colour: Floats, *, sd_deg: float, source: Source, reason: str = "") -> Illuminant:
    """An illuminant of any length (3,) whose error is alike in all directions.

    Raises BadInputError for a colour that is no light's: negative, zero or not finite.
    """
    unit = unit_colour(colour)
    spread = np.radians(sd_deg) ** 2 / 2 * (np.eye(3) - np.outer(unit, unit))
    return Illuminant(colour=unit, covariance=spread, source=source, reason=reason)


def unit_colour(colour: Floats) -> Floats:
    """The colour (3,) at length 1; raises BadInputError where it has a negative number, or none above 0."""
    colour = np.asarray(colour, float)
    if colour.shape != (3,) or not np.all(np.isfinite(colour)) or np.any(colour < 0) or not np.any(colour > 0):
        raise BadInputError(f"light colour is {colour.tolist()}; expected three numbers, none negative, not all 0")
    return np.asarray(colour / np.linalg.norm(colour))


def best_illuminant(
    picture: Floats,
    *,
    variance: Floats | Noise,
    usable: Mask | None = None,
    bloom: Mask | None = None,
    on_sphere: Mask | None = None,
    known: Sequence[Illuminant] = (),
    camera_white: Floats | None = None,
    source: Source | Literal["auto"] = "auto",
) -> Illuminant:
    """The most reliable illuminant there is: of `known` ones, else estimated from the picture's own highlight.

    `picture` and what describes it as for `separate`; `known` from `illuminant`, `grey_card`, `common_line`;
    `camera_white` (3,) the camera's colour of a neutral surface; `source` insists on one way.
    Raises BadInputError where the way insisted on gives nothing.
    """
    found = [*known, *_plain(camera_white)]
    if source in ("auto", *ALIKE) and not any(RANK.index(each.source) < RANK.index(ALIKE[0]) for each in known):
        ready = samples(picture, variance=variance, usable=usable, bloom=bloom, on_sphere=on_sphere)
        found += from_highlight(ready)
    if source != "auto":
        found = [each for each in found if each.source == source]
        if not found:
            raise BadInputError(f"the light's colour cannot be had from {source!r} here; use auto, or give it")
        return found[0]
    return _choose(found)


def of_samples(ready: Samples) -> Illuminant:
    """The best that a single picture of a single body tells, else taken as neutral."""
    return _choose([*from_highlight(ready), *_plain(None)])


def _plain(camera_white: Floats | None) -> list[Illuminant]:
    assumed = illuminant(np.ones(3), sd_deg=ASSUMED_SD_DEG, source="assumed", reason="nothing tells; taken as neutral")
    if camera_white is None:
        return [assumed]
    reason = "the camera's own white balance"
    return [illuminant(camera_white, sd_deg=CAMERA_SD_DEG, source="camera", reason=reason), assumed]


def from_highlight(ready: Samples) -> list[Illuminant]:
    """What a single body's highlight tells, by each way that finds one."""
    from .highlight_colour import by_highlight_line  # they build on this module
    from .inverse_intensity import by_inverse_intensity

    ways: tuple[Callable[[Samples], Illuminant | None], ...] = (by_highlight_line, by_inverse_intensity)
    return [each for each in (way(ready) for way in ways) if each is not None]


def _choose(found: Sequence[Illuminant]) -> Illuminant:
    """By rank; those estimated from one body, or taken on trust, by the error they state."""

    def order(each: Illuminant) -> tuple[int, float]:
        weak = RANK.index(each.source) >= RANK.index(ALIKE[0])
        return (RANK.index(ALIKE[0]), each.sd_deg) if weak else (RANK.index(each.source), each.sd_deg)

    ranked = sorted(found, key=order)
    best = ranked[0]
    others = ", ".join(f"{each.source} {each.sd_deg:.1f}" for each in ranked[1:])
    why = f"{best.reason or best.source}; error {best.sd_deg:.2g} degrees" + (f" (others: {others})" if others else "")
    return Illuminant(colour=best.colour, covariance=best.covariance, source=best.source, reason=why)
