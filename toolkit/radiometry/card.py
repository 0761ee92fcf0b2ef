"""The light's strength from a card of known reflectance: E = pi L / (rho cos theta), for a Lambertian card.

L is the card's mean radiance, rho its reflectance, theta the angle between its normal and the light. Nothing else
lights the card, and the lens shades it no more than the ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.errors import BadInputError
from toolkit.radiometry.quads import Quads
from toolkit.records import Floats, Metadata, Noise, readonly

LEAST_SIDE_PX = 8
BLOCKS = 4  # along each side: where the card is compared with itself
UNEVEN = 0.1  # relative sd of the blocks beyond the noise, from which it is no even card
DARK = 0.02  # relative error of the mean from which the card is too dark
MOST_FLAGGED = 0.01
SETTINGS_SD = 0.03  # of a ratio of exposures: nominal times and stops are rounded, 1/60 s stands for 1/64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Card:
    """Mean radiance (3,) of the card, image units, and its relative sd (3,): noise, and what the card is uneven by."""

    radiance: Floats
    relative_sd: Floats

    def __post_init__(self) -> None:
        readonly(self)


def measure_card(picture: Quads, box_px: tuple[int, int, int, int], noise: Noise) -> Card:
    """The card in the rectangle x, y, width, height (pixels of the photograph).

    Raises BadInputError, in one line, for a card that is small, clipped, dark or uneven.
    """
    values, flagged = _inside(picture, box_px)
    if min(values.shape[:2]) * picture.step_px < LEAST_SIDE_PX:
        raise BadInputError(
            f"the reference card is {box_px[2]} x {box_px[3]} px; expected {LEAST_SIDE_PX} or more each way"
        )
    if flagged.mean() > MOST_FLAGGED:
        raise BadInputError(
            f"{flagged.mean():.0%} of the reference card is clipped; expected none: shorten the exposure, "
            "or photograph the card by itself"
        )
    mean = values[~flagged].mean(axis=0, dtype=float)
    variance = np.array([float(noise.variance(np.array(mean[c]), c)) for c in range(3)])
    noise_sd = np.sqrt(variance / np.count_nonzero(~flagged))
    if np.any(mean <= 0.0) or np.any(noise_sd > DARK * mean):
        raise BadInputError(
            f"the reference card is dark: its mean is {', '.join(f'{m:.2g}' for m in mean)} of white; expected it lit "
            "by the ball's lamp: choose its box anew, or expose longer"
        )
    uneven = _uneven(values, flagged, variance) / mean
    if uneven.max() > UNEVEN:
        raise BadInputError(
            f"the reference card varies by {uneven.max():.0%} across its box; expected one even patch: "
            "leave its edge, shadows and gloss out of the box"
        )
    return Card(radiance=mean, relative_sd=np.hypot(noise_sd / mean, uneven))


def _inside(picture: Quads, box_px: tuple[int, int, int, int]) -> tuple[Floats, np.ndarray]:
    """Values (h, w, 3) and flags (h, w) of the pixels or quads that lie within the box."""
    (x0, y0), step = picture.origin_px, picture.step_px
    x, y, width, height = box_px
    left, top = int(np.ceil((x - x0) / step)), int(np.ceil((y - y0) / step))
    right, bottom = int(np.floor((x + width - 1 - x0) / step)) + 1, int(np.floor((y + height - 1 - y0) / step)) + 1
    part = slice(max(top, 0), max(bottom, 0)), slice(max(left, 0), max(right, 0))
    return picture.values[part], picture.flags[part] != 0


def _uneven(values: Floats, flagged: np.ndarray, variance: Floats) -> Floats:
    """Sd (3,) of the means of 4 x 4 blocks beyond what the noise gives them."""
    kept = np.where(flagged[..., None], np.nan, values)
    rows = [np.array_split(row, BLOCKS, axis=1) for row in np.array_split(kept, BLOCKS, axis=0)]
    blocks = [block.reshape(-1, 3) for row in rows for block in row]
    usable = [block for block in blocks if np.isfinite(block[:, 0]).any()]
    means = np.array([np.nanmean(block, axis=0, dtype=float) for block in usable])
    expected = variance * np.mean([1.0 / np.isfinite(block[:, 0]).sum() for block in usable])
    return np.asarray(np.sqrt(np.maximum(means.var(axis=0, ddof=1) - expected, 0.0)))


def exposure_ratio(ball: Metadata, card: Metadata) -> tuple[float, float]:
    """The card's radiance times this is what the ball's exposure would have shown, and the ratio's relative sd.

    Raw values grow with exposure time x ISO / f-number^2. What neither file tells is taken as the same. Raises
    BadInputError where only one of them tells, or they are of two cameras.
    """
    names = [f"{one.make} {one.model}".strip() for one in (ball, card)]
    if names[0] != names[1]:
        raise BadInputError(
            f"the card was taken with {names[1] or 'an unnamed camera'}, the ball with "
            f"{names[0] or 'an unnamed camera'}; expected one camera"
        )
    ratio = 1.0
    for field, power in (("exposure_s", 1), ("iso", 1), ("f_number", -2)):
        of_ball, of_card = getattr(ball, field), getattr(card, field)
        if (of_ball is None) != (of_card is None):
            raise BadInputError(
                f"only the {'ball' if of_card is None else 'card'} tells its {field}; expected both or neither: "
                "take both with one camera, as raw files"
            )
        ratio *= (of_ball / of_card) ** power if of_ball else 1.0
    return ratio, 0.0 if ratio == 1.0 else SETTINGS_SD
