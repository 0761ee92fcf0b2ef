"""What every kind of light shares: one strict schema for scene file and result."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

LARGEST = 1e12  # of any number; its inverse is the least of a positive one: their squares are still numbers


def _large_enough(value: float) -> float:
    if value < 1 / LARGEST:
        raise ValueError(f"expected a number >= {1 / LARGEST:g}")
    return value


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0, le=LARGEST), AfterValidator(_large_enough)]
Degrees = Annotated[float, Field(ge=0, le=90)]
Relative = Annotated[float, Field(ge=0, le=1)]
Vector = tuple[Number, Number, Number]
Colour = tuple[Positive, Positive, Positive]


class LightModel(BaseModel):
    """Base of the kinds: frozen, no unknown keys, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def check_irradiance(irradiance: Colour | None, relative_sd: float | None) -> None:
    """Refuse an error of an irradiance that is not told; raises ValueError."""
    if relative_sd is not None and irradiance is None:
        raise ValueError("irradiance_relative_sd says how well irradiance is known; give irradiance as well")


def unit(vector: Vector) -> Vector:
    """The vector at length 1; raises ValueError where it has none."""
    length = float(np.linalg.norm(vector))
    if length < 1e-12:
        raise ValueError(f"light direction {list(vector)} has no length; expected a vector towards the light")
    if abs(length - 1.0) < 1e-12:
        return vector  # so that what was written is read back to the last bit
    x, y, z = (float(v) / length for v in vector)
    return x, y, z
