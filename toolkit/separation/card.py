"""The light's colour from a neutral surface in the same light: a grey card, a white patch of a chart."""

from __future__ import annotations

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Floats, Noise

from .illuminant import Illuminant, unit_colour
from .samples import Mask, Samples, samples

CARD_SD_DEG = 0.5  # how neutral a card is: the better ones
TRIM = 0.1  # of the pixels at either end: dust, print, an edge
UNEVEN_DEG = 3.0  # spread of hue within the rectangle beyond the noise, above which it is no card


def grey_card(
    picture: Floats,
    box: tuple[int, int, int, int],
    *,
    variance: Floats | Noise,
    usable: Mask | None = None,
    card_sd_deg: float = CARD_SD_DEG,
) -> Illuminant:
    """Mean colour of the rectangle `box` (x0, y0, x1, y1), ends exclusive, of a linear `picture` (h, w, 3).

    Shading across the card does no harm: brightness is divided out pixel by pixel before the hue is averaged.
    Raises BadInputError where the rectangle leaves the picture, clips, is dark or not of one hue.
    """
    x0, y0, x1, y1 = box
    h, w = np.shape(picture)[:2]
    if not (0 <= x0 < x1 <= w and 0 <= y0 < y1 <= h):
        raise BadInputError(f"grey card at {list(box)} lies outside the picture of {w} x {h}; expected x0, y0, x1, y1")
    inside = np.zeros((h, w), bool)
    inside[y0:y1, x0:x1] = True
    ready = samples(picture, variance=variance, usable=usable, on_sphere=inside)
    return _from_samples(ready, (x1 - x0) * (y1 - y0), card_sd_deg)


def _from_samples(ready: Samples, area: int, card_sd_deg: float) -> Illuminant:
    full = ready.weight > 0
    if np.count_nonzero(full) < 0.5 * area:
        raise BadInputError("more than half of the grey card is clipped or invalid; expose less")
    colour = ready.values[full]
    variance = np.broadcast_to(ready.variance, ready.values.shape)[full]
    total = colour.sum(axis=1)
    middle = (total >= np.quantile(total, TRIM)) & (total <= np.quantile(total, 1 - TRIM))
    colour, variance = colour[middle], variance[middle]
    mean = unit_colour(np.maximum(colour.mean(axis=0), 0.0))
    length = float(colour.mean(axis=0) @ mean)
    across = np.eye(3) - np.outer(mean, mean)
    noise = across @ np.diag(variance.mean(axis=0)) @ across / length**2
    spread = np.cov((colour @ across / (colour @ mean)[:, None]).T)
    uneven = float(np.degrees(np.sqrt(max(np.trace(spread) - np.trace(noise), 0.0))))
    if length < 5 * float(np.sqrt(variance.mean())) or uneven > UNEVEN_DEG + float(
        np.degrees(np.sqrt(np.trace(noise)))
    ):
        raise BadInputError(f"the grey card is dark or varies in hue by {uneven:.1f} degrees; expected one even patch")
    own = np.radians(card_sd_deg) ** 2 / 2 * across
    return Illuminant(
        colour=mean, covariance=spread / len(colour) + own, source="card", reason="mean colour of the grey card"
    )
