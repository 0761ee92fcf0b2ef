"""Numbers with as many digits as they deserve: the sd to two, the estimate to the same place."""

from __future__ import annotations

import math

FEWEST, MOST = 0, 6  # decimals; beyond, powers of ten


def plus_minus(value: float, sd: float) -> str:
    """`0.12003 ± 0.00031`; four digits of the value alone where the sd is not known."""
    if not (math.isfinite(sd) and sd > 0):
        return f"{value:.4g}"
    return f"{rounded(value, sd)} ± {rounded(sd, sd)}"


def interval(low: float, high: float, sd: float) -> str:
    """`0.1195 to 0.1205`; empty where it is not known."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f"{rounded(low, sd)} to {rounded(high, sd)}"


def rounded(value: float, sd: float) -> str:
    """The value to the second digit of its sd; with a power of ten where that is far from the point."""
    if not (math.isfinite(sd) and sd > 0):
        return f"{value:.6g}"
    decimals = 1 - math.floor(math.log10(float(f"{sd:.1e}")))  # an sd of 0.0996 has the place of 0.10
    if decimals > MOST and abs(value) < 1e-3:
        digits = decimals + math.floor(math.log10(abs(value))) if value else 0
        return f"{value:.{max(digits, 0)}e}"
    return f"{value:.{min(max(decimals, FEWEST), 12)}f}"
