"""The pieces of a plot as SVG of the page's own colours, and the axes that place them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from pipelines.report.numbers import MINUS

WIDTH = 640
LEFT, RIGHT, TOP = 62, 12, 14


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Values from `low` to `high` over pixels from `start` to `end`; logarithmic or not."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool = False

    def at(self, value: float) -> float:
        """The pixel of a value, held within the axis."""
        low, high, value = (self._scaled(v) for v in (self.low, self.high, min(max(value, self.low), self.high)))
        return self.start + (self.end - self.start) * (value - low) / (high - low)

    def holds(self, value: float) -> bool:
        """Whether the value lies within the axis."""
        return self.low <= value <= self.high

    def _scaled(self, value: float) -> float:
        return math.log(value) if self.logarithmic else value

    def ticks(self) -> list[float]:
        """Round values along the axis."""
        span = self.high / self.low if self.logarithmic else 1.0
        if span < 4:
            return _round_values(self.low, self.high)
        steps = (1, 1.5, 2, 3, 5, 7) if span < 10 else (1, 2, 5) if span < 300 else (1,)
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        return [v for p in powers for s in steps if self.holds(v := s * 10.0**p)]


def _round_values(low: float, high: float) -> list[float]:
    raw = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(i * step, 12) for i in range(first, math.floor(high / step + 1e-9) + 1)]


def grid(y: Axis, bottom: float) -> Iterator[Markup]:
    """Lines across at the ticks of `y`, their numbers, and the edge below."""
    for value in y.ticks():
        yield line("grid", LEFT, y.at(value), WIDTH - RIGHT, y.at(value))
        yield text("tick", LEFT - 7, y.at(value) + 4, label(value), "end")
    yield line("edge", LEFT, bottom, WIDTH - RIGHT, bottom)


def label(value: float) -> str:
    """A tick's number."""
    return f"{value:.10g}".replace("-", MINUS)


def line(kind: str, x1: float, y1: float, x2: float, y2: float) -> Markup:
    """A straight line of a CSS class."""
    return Markup('<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>').format(kind, x1, y1, x2, y2)


def band(kind: str, top: float, bottom: float) -> Markup:
    """A band over the plot's whole width."""
    return Markup('<rect class="{}" x="{}" y="{:.1f}" width="{}" height="{:.1f}"/>').format(
        kind, LEFT, top, WIDTH - RIGHT - LEFT, max(bottom - top, 0.5)
    )


def text(kind: str, x: float, y: float, words: str, anchor: str) -> Markup:
    """Words at a place."""
    return Markup('<text class="{}" x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>').format(kind, x, y, anchor, words)


def plot(parts: Sequence[Markup], words: str, *, height: int) -> Markup:
    """The whole drawing; `words` say what it shows to those who cannot see it."""
    opening = Markup('<svg viewBox="0 0 {} {}" class="figure plot" role="group" aria-label="{}">').format(
        WIDTH, height, words
    )
    return opening + Markup("\n").join(parts) + Markup("</svg>")
