"""What a limb is fitted with: centre, radius, blur, the light and how matte the ball is, and where they stay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

NUMBERS = 7  # centre x, y, radius (px), log blur (samples), the light's two tilts (rad), how matte
MATTE, MOST_MATTE = 6, 0.95  # place among the numbers: 0 under a smooth coat, at most where a coat darkens no limb
HALF_MATTE = 0.25  # a coat's roughness half-way: so measured, equal steps change the limb's shading by about the same
LEAST_BLUR_PX = 0.41  # sd: a pixel's own area and a lens of 0.25 px, which none betters
MOST_BLUR = 4.0  # samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Where the fit stands: `numbers` as in NUMBERS, tilts taken into the light's direction."""

    numbers: Floats  # (NUMBERS,)
    light: Floats  # (3,), unit: x, y as in the picture, z to the camera

    def __post_init__(self) -> None:
        readonly(self)

    @property
    def shape(self) -> Floats:
        """Centre x, y and radius (3,), px."""
        return self.numbers[:3]

    @property
    def blur(self) -> float:
        """Standard deviation of the limb's blur, samples."""
        return float(np.exp(self.numbers[3]))

    def moved(self, by: Floats, step_px: float) -> State:
        """The state after a step (NUMBERS,), in a picture of such samples."""
        there = self.displaced(by)
        return State(numbers=np.clip(there.numbers, *bounds(step_px)), light=there.light)

    def displaced(self, by: Floats) -> State:
        """The state after a step, whatever its bounds."""
        light = self.light + by[4:6] @ tangents(self.light)
        numbers = self.numbers + np.where(np.isin(np.arange(NUMBERS), (4, 5)), 0.0, by)
        return State(numbers=numbers, light=light / np.linalg.norm(light))


def tangents(light: Floats) -> Floats:
    """Two unit vectors (2, 3) across a direction (Duff et al. 2017)."""
    x, y, z = light
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    return np.array([[1.0 + sign * x * x * a, sign * x * y * a, -sign * x], [x * y * a, sign + y * y * a, -y]])


def roughness(matte: float) -> float:
    """Of the coat."""
    return float(HALF_MATTE * np.sqrt(matte / (1.0 - matte)))


def bounds(step_px: float) -> tuple[Floats, Floats]:
    """Between what the numbers stay."""
    low, high = np.full(NUMBERS, -np.inf), np.full(NUMBERS, np.inf)
    low[3], high[3] = np.log(LEAST_BLUR_PX / step_px), np.log(MOST_BLUR)
    low[MATTE], high[MATTE] = 0.0, MOST_MATTE
    return low, high
