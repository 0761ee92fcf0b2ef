"""Separation into body and light by colour alone; what needs the known shape lives in `toolkit.inference`."""

from .dichromatic import separate

__all__ = ["separate"]
