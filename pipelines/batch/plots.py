"""The batch's plots: drawn by hand, since a point must lead to its row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from markupsafe import Markup

from pipelines.report.numbers import digits

from . import svg
from .materials import Member, Parameter
from .pool import Pooled
from .rows import Row
from .svg import LEFT, RIGHT, TOP, WIDTH, Axis

HEIGHT, BOTTOM = 400, 46
STRIP_HEIGHT, STRIP_BOTTOM = 230, 30
COLOURS = 8  # --fit-0 .. --fit-7 of the page's style
MOST_LINKED = 200  # photographs of a material that are drawn one by one; beyond, only those far out


def gloss_plot(rows: Sequence[Row], colour_of: dict[str, int]) -> Markup | None:
    """Width against strength of every highlight, a point a photograph, in its material's colour."""
    told = [(index, row.number("alpha_ggx"), row.number("strength_ggx")) for index, row in enumerate(rows)]
    points = [
        (index, alpha, strength)
        for index, alpha, strength in told
        if rows[index].cells["status"] == "done" and alpha and strength and min(alpha, strength) > 0
    ]
    if not points:
        return None
    x = _logarithmic([alpha for _, alpha, _ in points], LEFT, WIDTH - RIGHT)
    y = _logarithmic([strength for _, _, strength in points], HEIGHT - BOTTOM, TOP)
    marks = [
        _mark(
            index,
            f"{rows[index].cells['photograph']}: alpha {digits(alpha)}, strength {digits(strength)}",
            _dot(x.at(alpha), y.at(strength), 4.5),
            colour=colour_of.get(str(rows[index].cells["material"]), 0),
            far=bool(rows[index].cells.get("outlier")),
        )
        for index, alpha, strength in points
    ]
    words = "Specular strength against roughness, one point a photograph"
    return svg.plot(
        [*_frame(x, y, "roughness: alpha of the nearest GGX lobe", "specular strength"), *marks], words, height=HEIGHT
    )


def _logarithmic(values: Sequence[float], start: float, end: float) -> Axis:
    low, high = min(values), max(values)
    room = max((high / low) ** 0.06, 1.08)
    return Axis(low=low / room, high=high * room, start=start, end=end, logarithmic=True)


def _frame(x: Axis, y: Axis, x_name: str, y_name: str) -> Iterator[Markup]:
    yield from svg.grid(y, HEIGHT - BOTTOM)
    for value in x.ticks():
        yield svg.line("grid", x.at(value), TOP, x.at(value), HEIGHT - BOTTOM)
        yield svg.text("tick", x.at(value), HEIGHT - BOTTOM + 17, svg.label(value), "middle")
    yield svg.text("axis", (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 8, x_name, "middle")
    yield Markup(
        '<text class="axis" text-anchor="middle" transform="translate(14 {:.1f}) rotate(-90)">{}</text>'
    ).format((TOP + HEIGHT - BOTTOM) / 2, y_name)


def _mark(row: int, title: str, drawn: Markup, *, colour: int, far: bool) -> Markup:
    """What stands for a photograph: a link to its row, that says its numbers when pointed at."""
    return Markup('<a href="#p{}" class="mark c{}{}"><title>{}</title>{}</a>').format(
        row, colour % COLOURS, " far" if far else "", title, drawn
    )


def _dot(x: float, y: float, radius: float) -> Markup:
    return Markup('<circle cx="{:.1f}" cy="{:.1f}" r="{}"/>').format(x, y, radius)


def _arrow(x: float, y: float, *, up: bool) -> Markup:
    """Beyond the plot's edge."""
    return Markup('<path class="beyond" d="M{:.1f} {:.1f}l-4.5 {}h9z"/>').format(x, y, 8 if up else -8)


def strip_plot(parameter: Parameter, rows: Sequence[Row], colour: int) -> Markup | None:
    """One parameter over a material's photographs: estimates with their sd, the pooled mean, and where a further one
    would lie.
    """
    found, members = parameter.pooled, parameter.members
    if found is None:
        return None
    low, high = _ends(members, found)
    y = Axis(low=low, high=high, start=STRIP_HEIGHT - STRIP_BOTTOM, end=TOP)
    x = Axis(low=-0.7, high=len(members) - 0.3, start=LEFT, end=WIDTH - RIGHT)
    dense = len(members) > MOST_LINKED
    parts = [*svg.grid(y, STRIP_HEIGHT - STRIP_BOTTOM), *_pooled(found, y)]
    if dense:
        parts.append(_cloud(members, x, y, colour))
    parts += [
        _mark(m.row, _told(m, rows), _estimate(m, x.at(place), y), colour=colour, far=m.outlier)
        for place, m in enumerate(members)
        if m.outlier or not dense
    ]
    parts.append(svg.text("axis", (LEFT + WIDTH - RIGHT) / 2, STRIP_HEIGHT - 6, "photographs, in order", "middle"))
    words = f"{parameter.name} {parameter.channel} of each photograph, with the pooled mean"
    return svg.plot(parts, words, height=STRIP_HEIGHT)


def _ends(members: Sequence[Member], found: Pooled) -> tuple[float, float]:
    """Where the axis ends: around the values, of which those that one photograph hardly determines do not dwarf the
    others, and around the error bars as far as they do not.
    """
    low, high = found.low, found.high
    if found.expect_low is not None and found.expect_high is not None:
        low, high = found.expect_low, found.expect_high
    near = [m.value for m in members if m.outlier or low - (high - low) <= m.value <= high + (high - low)]
    low, high = min([*near, low]), max([*near, high])
    reach = 0.5 * (high - low) or abs(high) * 0.01 or 1.0
    bars = [end for m in members for end in (m.value - m.sd, m.value + m.sd)]
    low, high = max(min(*bars, low), low - reach), min(max(*bars, high), high + reach)
    room = 0.06 * (high - low) or abs(high) * 0.01 or 1.0
    return low - room, high + room


def _pooled(found: Pooled, y: Axis) -> Iterator[Markup]:
    if found.expect_low is not None and found.expect_high is not None:
        yield svg.band("expect", y.at(found.expect_high), y.at(found.expect_low))
    yield svg.band("mean", y.at(found.high), y.at(found.low))
    yield svg.line("middle", LEFT, y.at(found.mean), WIDTH - RIGHT, y.at(found.mean))


def _estimate(m: Member, x: float, y: Axis) -> Markup:
    """A photograph's own number, with a bar of one sd."""
    drawn = _dot(x, y.at(m.value), 3.6) if y.holds(m.value) else _arrow(x, y.at(m.value), up=m.value > y.high)
    return svg.line("bar", x, y.at(m.value - m.sd), x, y.at(m.value + m.sd)) + drawn


def _told(m: Member, rows: Sequence[Row]) -> str:
    away = "" if m.away is None else f", {digits(abs(m.away), 2)} sd from the others"
    return f"{rows[m.row].cells['photograph']}: {digits(m.value)} ± {digits(m.sd, 2)}{away}"


def _cloud(members: Sequence[Member], x: Axis, y: Axis, colour: int) -> Markup:
    """Many photographs as two paths: their error bars, their estimates."""
    places = [(x.at(place), m) for place, m in enumerate(members)]
    bars = "".join(f"M{at:.1f} {y.at(m.value - m.sd):.1f}V{y.at(m.value + m.sd):.1f}" for at, m in places)
    dots = "".join(f"M{at:.1f} {y.at(m.value):.1f}h.01" for at, m in places)
    return Markup('<g class="mark c{}"><path class="bar" d="{}"/><path class="dots" d="{}"/></g>').format(
        colour % COLOURS, bars, dots
    )
