"""The examination in one sentence."""

from __future__ import annotations

from .records import Examination


def verdict(found: Examination) -> str:
    """Whether to fit this photograph, and how much is to be changed."""
    serious = sum(one.serious for one in found.advice)
    if found.error is not None:
        return "A fit would stop here; what could be read is below."
    if serious:
        things = "one thing" if serious == 1 else f"{serious} things"
        return f"A fit would run and suffer: change {things} in the next photograph."
    if found.advice:
        return "Good to fit; the next photograph could be better still."
    return "Good to fit: nothing to change."
