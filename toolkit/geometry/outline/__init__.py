"""The sphere's outline, to a fraction of a pixel and with its covariance."""

from .find import Outline, find_sphere

__all__ = ["Outline", "find_sphere"]
