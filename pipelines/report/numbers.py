"""Numbers as a person reads them: as many digits as the uncertainty allows."""

from __future__ import annotations

import math

MINUS = "\N{MINUS SIGN}"
MISSING = "–"
FINEST = 7  # decimals before an exponent reads better


def measured(value: float | None, sd: float | None) -> str:
    """The value with two digits of its sd: 0.12000 for 0.12 and 0.00012; four digits where no sd is known."""
    if value is None or not math.isfinite(value):
        return MISSING
    if sd is None or not math.isfinite(sd) or sd <= 0.0:
        return digits(value)
    decimals = 1 - math.floor(math.log10(sd) + 1e-9)
    if value != 0.0 and (decimals > FINEST or abs(value) >= 1e7):
        after_first = decimals + math.floor(math.log10(abs(value)))
        return _signed(f"{value:.{max(after_first, 0)}e}")
    return _signed(f"{round(value, decimals):.{max(decimals, 0)}f}")


def digits(value: float | None, count: int = 4) -> str:
    """The value to so many significant digits, without an exponent where it reads well without."""
    if value is None or not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if -6 <= power < 7:
        return _signed(f"{value:.{max(count - 1 - power, 0)}f}")
    return _signed(f"{value:.{count - 1}e}")


def percent(value: float | None, count: int = 2) -> str:
    """A share as a percentage: 4.1 %."""
    return MISSING if value is None or not math.isfinite(value) else f"{digits(100 * value, count)} %"


def _signed(text: str) -> str:
    return text.replace("-", MINUS, 1) if text.startswith("-") else text
