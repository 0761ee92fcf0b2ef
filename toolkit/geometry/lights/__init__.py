"""The kinds of light. Adding one: a file beside these, and its name in `AnyLight`."""

from typing import Annotated

from pydantic import Field

from .directional import DirectionalLight
from .point import PointLight

AnyLight = Annotated[DirectionalLight | PointLight, Field(discriminator="kind")]

__all__ = ["AnyLight", "DirectionalLight", "PointLight"]
