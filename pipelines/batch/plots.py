"""The batch's plots as SVG of the page's own colours: drawn by hand, since a point must lead to its row."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from pipelines.report.numbers import digits

from .materials import Member, Parameter
from .rows import Row

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 62, 12, 14, 46
COLOURS = 8  # --fit-0 .. --fit-7 of the page's style


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

    def _scaled(self, value: float) -> float:
        return math.log(value) if self.logarithmic else value

    def ticks(self) -> list[float]:
        """Round values along the axis."""
        if not self.logarithmic:
            return _round_values(self.low, self.high)
        powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        steps = (1, 2, 5) if self.high / self.low < 300 else (1,)
        if self.high / self.low < 4:
            return _round_values(self.low, self.high)
        return [v for p in powers for s in steps if self.low <= (v := s * 10.0**p) <= self.high]


def _round_values(low: float, high: float) -> list[float]:
    raw = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(i * step, 12) for i in range(first, math.floor(high / step + 1e-9) + 1)]


def gloss_plot(rows: Sequence[Row], colour_of: dict[str, int]) -> Markup | None:
    """Width against strength of every highlight, a point a photograph, in its material's colour."""
    points = [
        (index, float(row.cells["alpha_ggx"]), float(row.cells["strength_ggx"]))  # type: ignore[arg-type]  # numbers
        for index, row in enumerate(rows)
        if row.cells["status"] == "done"
        and _positive(row.cells.get("alpha_ggx"))
        and _positive(row.cells.get("strength_ggx"))
    ]
    if not points:
        return None
    x = _axis([alpha for _, alpha, _ in points], LEFT, WIDTH - RIGHT)
    y = _axis([strength for _, _, strength in points], HEIGHT - BOTTOM, TOP)
    marks = Markup("").join(
        _point(index, rows[index], x.at(alpha), y.at(strength), colour_of) for index, alpha, strength in points
    )
    return _svg(
        [*_frame(x, y, "roughness: alpha of the nearest GGX lobe", "specular strength"), marks],
        "Specular strength against roughness, one point a photograph",
    )


def _positive(value: object) -> bool:
    return isinstance(value, float | int) and value > 0


def _axis(values: Sequence[float], start: float, end: float) -> Axis:
    """Around the values, logarithmic."""
    low, high = min(values), max(values)
    room = max((high / low) ** 0.06, 1.08)
    return Axis(low=low / room, high=high * room, start=start, end=end, logarithmic=True)


def _point(index: int, row: Row, x: float, y: float, colour_of: dict[str, int]) -> Markup:
    colour = colour_of.get(str(row.cells["material"]), 0) % COLOURS
    far = " far" if row.cells.get("outlier") else ""
    alpha, strength = digits(_float(row, "alpha_ggx")), digits(_float(row, "strength_ggx"))
    title = f"{row.cells['photograph']}: alpha {alpha}, strength {strength}"
    return Markup(
        '<a href="#p{}" class="mark c{}{}"><title>{}</title><circle cx="{:.1f}" cy="{:.1f}" r="4.5"/></a>'
    ).format(index, colour, far, title, x, y)


def _float(row: Row, name: str) -> float | None:
    value = row.cells.get(name)
    return float(value) if isinstance(value, float | int) else None


STRIP_HEIGHT = 230
MOST_LINKED = 200  # photographs of a material that are drawn one by one; beyond, only those far out


def _cloud(members: Sequence[tuple[float, Axis, Member]], colour: int) -> Markup:
    """Many photographs as two paths: their error bars, their estimates."""
    bars = "".join(f"M{at:.1f} {y.at(m.value - m.sd):.1f}V{y.at(m.value + m.sd):.1f}" for at, y, m in members)
    dots = "".join(f"M{at:.1f} {y.at(m.value):.1f}h.01" for at, y, m in members)
    return Markup('<g class="mark c{}"><path class="bar" d="{}"/><path class="dots" d="{}"/></g>').format(
        colour % COLOURS, bars, dots
    )


def strip_plot(parameter: Parameter, rows: Sequence[Row], colour: int) -> Markup | None:
    """One parameter over a material's photographs: estimates with their sd, the pooled mean, and where a further one
    would lie.
    """
    found = parameter.pooled
    if found is None:
        return None
    members = parameter.members
    ends = [v for m in members for v in (m.value - m.sd, m.value + m.sd)]
    ends += [v for v in (found.low, found.high, found.expect_low, found.expect_high) if v is not None]
    low, high = _robust_ends(ends, [m.value for m in members])
    bottom = STRIP_HEIGHT - 30
    y = Axis(low=low, high=high, start=bottom, end=TOP)
    x = Axis(low=-0.7, high=len(members) - 0.3, start=LEFT, end=WIDTH - RIGHT)
    parts = [*_lines(y, bottom)]
    if found.expect_low is not None and found.expect_high is not None:
        parts.append(_band("expect", y.at(found.expect_high), y.at(found.expect_low)))
    parts.append(_band("mean", y.at(found.high), y.at(found.low)))
    parts.append(_line("middle", LEFT, y.at(found.mean), WIDTH - RIGHT, y.at(found.mean)))
    dense = len(members) > MOST_LINKED
    if dense:
        parts.append(_cloud([(x.at(place), y, m) for place, m in enumerate(members)], colour))
    for place, m in enumerate(members):
        if dense and not m.outlier:
            continue
        at = x.at(place)
        bar = _line("bar", at, y.at(m.value - m.sd), at, y.at(m.value + m.sd))
        name = rows[m.row].cells["photograph"]
        away = "" if m.away is None else f", {digits(abs(m.away), 2)} sd from the others"
        parts.append(
            Markup(
                '<a href="#p{}" class="mark c{}{}"><title>{}</title>{}<circle cx="{:.1f}" cy="{:.1f}" r="{}"/></a>'
            ).format(
                m.row,
                colour % COLOURS,
                " far" if m.outlier else "",
                f"{name}: {digits(m.value)} ± {digits(m.sd, 2)}{away}",
                bar,
                at,
                y.at(m.value),
                "3" if dense else "3.6",
            )
        )
    parts.append(_text("axis", (LEFT + WIDTH - RIGHT) / 2, STRIP_HEIGHT - 6, "photographs, in order", "middle"))
    label = f"{parameter.name} {parameter.channel} of each photograph, with the pooled mean"
    return _svg(parts, label, height=STRIP_HEIGHT)


def _robust_ends(ends: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """All values, and error bars as far as they do not dwarf them."""
    low, high = min(values), max(values)
    reach = 1.5 * (high - low) or 2 * (max(ends) - min(ends)) or abs(high) * 0.01 or 1.0
    low, high = max(min(ends), low - reach), min(max(ends), high + reach)
    room = 0.06 * (high - low) or abs(high) * 0.01 or 1.0
    return low - room, high + room


def _frame(x: Axis, y: Axis, x_name: str, y_name: str) -> Iterator[Markup]:
    yield from _lines(y, HEIGHT - BOTTOM)
    for value in x.ticks():
        yield _line("grid", x.at(value), TOP, x.at(value), HEIGHT - BOTTOM)
        yield _text("tick", x.at(value), HEIGHT - BOTTOM + 17, _label(value), "middle")
    yield _text("axis", (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, x_name, "middle")
    yield Markup(
        '<text class="axis" text-anchor="middle" transform="translate(14 {:.1f}) rotate(-90)">{}</text>'
    ).format((TOP + HEIGHT - BOTTOM) / 2, y_name)


def _lines(y: Axis, bottom: float) -> Iterator[Markup]:
    for value in y.ticks():
        yield _line("grid", LEFT, y.at(value), WIDTH - RIGHT, y.at(value))
        yield _text("tick", LEFT - 7, y.at(value) + 4, _label(value), "end")
    yield _line("edge", LEFT, bottom, WIDTH - RIGHT, bottom)


def _label(value: float) -> str:
    return f"{value:.10g}".replace("-", "\N{MINUS SIGN}")


def _line(kind: str, x1: float, y1: float, x2: float, y2: float) -> Markup:
    return Markup('<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>').format(kind, x1, y1, x2, y2)


def _band(kind: str, top: float, bottom: float) -> Markup:
    return Markup('<rect class="{}" x="{}" y="{:.1f}" width="{}" height="{:.1f}"/>').format(
        kind, LEFT, top, WIDTH - RIGHT - LEFT, max(bottom - top, 0.5)
    )


def _text(kind: str, x: float, y: float, text: str, anchor: str) -> Markup:
    return Markup('<text class="{}" x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>').format(kind, x, y, anchor, text)


def _svg(parts: Sequence[Markup], label: str, *, height: int = HEIGHT) -> Markup:
    opening = Markup('<svg viewBox="0 0 {} {}" class="figure plot" role="group" aria-label="{}">').format(
        WIDTH, height, escape(label)
    )
    return opening + Markup("\n").join(parts) + Markup("</svg>")
