"""The result on a terminal: the best model's parameters with honest digits, every model beside it, flags in words."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pipelines.srgb import srgb_of
from toolkit.flags import MEANING, Flag
from toolkit.records import CameraColour, Estimate, Fit, Floats, LinearImage, MaterialReport, Reference, Scene

from .digits import interval, plus_minus, rounded
from .rows import concerned, elpd_difference, ranking
from .text import base_name, clean

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text


class Row(NamedTuple):
    """One line of the parameter table."""

    name: str
    channel: str
    value: str
    interval: str
    unit: str


def print_table(report: MaterialReport, console: Console, *, where: Path | None = None) -> None:
    """Print the result; `where` is the page, or the folder, that the last line points to. Plain in a pipe."""
    for line in _head(report):
        _print(console, line)
    if report.fits:
        best = report.fits[report.best]
        _print(console, "")
        _print(console, f"{_named(best)}: {_rank(report)}")
        _print(console, _quality(best))
        _print_table(console, _parameters(best))
        for coloured in _colours(report, best):
            console.print(coloured, highlight=False, soft_wrap=True)
        if len(report.fits) > 1:
            _print_table(console, _models(report, best))
        _print(console, "")
    for line in _remarks(report):
        _print(console, line)
    if where is not None:
        _print(console, f"report: {where}")


def _print(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=len(text) <= console.width or "/" in text)


def _print_table(console: Console, table: Table) -> None:
    """An empty line and the table, without spaces at its lines' ends."""
    with console.capture() as captured:
        console.print(table)
    console.file.write("\n" + "".join(f"{line.rstrip()}\n" for line in captured.get().splitlines()))


def _head(report: MaterialReport) -> Iterator[str]:
    if report.photographs:
        yield f"{len(report.photographs)} photographs of one material, fitted jointly, {report.scale} scale"
    for one in report.photographs or (report,):
        yield from _where_taken(one.image, one.scene)
        if one.reference is not None:
            yield _reference(one.reference)


def _where_taken(image: LinearImage, scene: Scene) -> Iterator[str]:
    size = f"{image.width_px} x {image.height_px} px"
    yield f"{base_name(image.name)}: {size}, {scene.camera.projection}, {scene.scale} scale"
    (x, y), sd = scene.sphere.centre_px, np.sqrt(np.diag(scene.sphere.covariance_px2))
    centre = f"({rounded(x, sd[0])}, {rounded(y, sd[1])})"
    yield f"sphere {scene.sphere.source}: centre {centre}, radius {plus_minus(scene.sphere.radius_px, sd[2])} px"
    for light in scene.lights:
        direction = ", ".join(f"{v:.3f}" for v in light.direction)
        off_deg = np.degrees(np.arccos(np.clip(light.direction[2], -1.0, 1.0)))
        yield f"{light.kind} light {scene.light_source}: ({direction}), {off_deg:.1f} degrees off the view axis"


def _reference(reference: Reference) -> str:
    told = (
        plus_minus(*pair) for pair in zip(reference.irradiance.tolist(), reference.irradiance_sd.tolist(), strict=True)
    )
    where = f" in {base_name(reference.file)}" if reference.file else ""
    return f"grey card{where}: irradiance {', '.join(told)}"


def _named(fit: Fit) -> str:
    variant = ", ".join(f"{option} {choice}" for option, choice in fit.variant.items())
    return clean(f"{fit.model}{f' ({variant})' if variant else ''} over {fit.diffuse}")


def _rank(report: MaterialReport) -> str:
    best = report.fits[report.best]
    if best.status != "converged":
        return clean(best.status)
    if len(report.fits) == 1:
        return "the only model fitted"
    return "best and preferred" if report.preferred == report.best else "best; the data do not decide"


def _quality(fit: Fit) -> str:
    chain = fit.diagnostics
    sampled = f"; {chain.ess_min:.0f} effective samples, R-hat {chain.r_hat_max:.3f}" if chain else ""
    return f"chi2/dof {fit.chi2_reduced:.3f}{sampled}"


def _told(fit: Fit) -> list[Estimate]:
    """The parameters, without the reflectance factor where it is the albedo once more."""
    return [p for p in fit.parameters if p.name != "reflectance_factor" or fit.diffuse != "lambert"]


def _parameters(fit: Fit) -> Table:
    table = _table("parameter", "", "estimate ± sd", "90 % interval", "unit")
    for parameter in _told(fit):
        for row in _rows(parameter):
            table.add_row(*map(_text, row))
    return table


def _colours(report: MaterialReport, fit: Fit) -> Iterator[Text]:
    """The reflectances in linear sRGB, each with its swatch where the scale is known."""
    from rich.text import Text

    seen = [(p.name, srgb) for p in _told(fit) if (srgb := srgb_of(report, fit, p)) is not None]
    if not seen or report.colour is None:
        return
    yield Text(f"\nlinear sRGB, {HOW[report.colour.source]}{_error(report.colour)}")
    for name, srgb in seen:
        line = Text(f"{name:18} " + "  ".join(map(rounded, srgb.estimate.tolist(), srgb.sd.tolist())))
        if srgb.hex is not None:
            line.append("  ").append("  ", style=f"on {srgb.hex}").append(f" {srgb.hex}")
        yield line


HOW = {
    "forward-matrix": "by the file's forward matrix",
    "colour-matrix": "by the file's colour matrix",
    "chart": "by the colour chart",
}


def _error(colour: CameraColour) -> str:
    return "" if colour.delta_e is None else f" (CIEDE2000 {colour.delta_e:.1f} on its patches)"


def _rows(parameter: Estimate) -> Iterator[Row]:
    """A number has one row, and one in degrees below where it is in radians; a colour has three."""
    if parameter.estimate is None:
        yield Row(parameter.name, "", "not identified", "", "")
        return
    estimate, sd = np.atleast_1d(parameter.estimate), _three(parameter.sd)
    low, high = parameter.interval_90 or (None, None)
    low, high = _three(low), _three(high)
    channels = [""] if len(estimate) == 1 else ["R", "G", "B"]
    if len(estimate) == 3 and np.ptp(estimate) == 0 and np.ptp(sd) == 0:
        channels = ["RGB"]  # a neutral colour: one number
    for c, channel in enumerate(channels):
        name = parameter.name if c == 0 else ""
        unit = "" if parameter.unit == "1" else parameter.unit
        yield Row(name, channel, plus_minus(estimate[c], sd[c]), interval(low[c], high[c], sd[c]), unit)
    if parameter.unit == "rad":
        value, spread, begin, end = np.degrees([estimate[0], sd[0], low[0], high[0]])
        yield Row("", "", plus_minus(value, spread), interval(begin, end, spread), "deg")


def _three(value: float | Floats | None) -> Floats:
    """One number or three as three; what is not there is NaN."""
    return np.broadcast_to(np.asarray(np.nan if value is None else value, float), (3,))


def _models(report: MaterialReport, best: Fit) -> Table:
    table = _table("model", "diffuse", "shape", "chi2/dof", "elpd below best", folded="shape")
    for fit in (report.fits[index] for index in ranking(report)):
        shape = ", ".join(f"{name} {value:.4g}" for name, value in fit.shape.items())
        name = fit.model + "".join(f":{option}={choice}" for option, choice in _unlike(fit, report).items())
        converged = fit.status == "converged"
        table.add_row(*map(_text, (name, fit.diffuse, shape, f"{fit.chi2_reduced:.3f}", _below(best, fit, converged))))
    return table


def _unlike(fit: Fit, report: MaterialReport) -> dict[str, str]:
    """The options in which another fit of the same model differs."""
    twins = [other.variant for other in report.fits if other.model == fit.model]
    return {
        option: choice for option, choice in fit.variant.items() if any(twin.get(option) != choice for twin in twins)
    }


def _below(best: Fit, fit: Fit, converged: bool) -> str:
    if not converged:
        return "not converged"
    if fit is best:
        return "best"
    ahead, sd = elpd_difference(best, fit)
    if ahead is None or sd is None:
        return f"{best.elpd - fit.elpd:.0f}"
    return plus_minus(-ahead, sd)


def _remarks(report: MaterialReport) -> Iterator[str]:
    best = report.fits[report.best] if report.fits else None
    for parameter in best.parameters if best else ():
        if parameter.note:
            yield f"{parameter.name}: {clean(parameter.note)}"
    for flag in dict.fromkeys((*report.flags, *(best.flags if best else ()))):
        said = f"{clean(flag)}: {MEANING[Flag(flag)]}" if flag in list(Flag) else clean(flag)
        whose = concerned(best, flag)
        yield f"{said} ({whose})" if whose else said


def _table(*heads: str, folded: str = "") -> Table:
    """Columns as wide as their words; the one to be `folded` gives way and takes more lines."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for head in heads:
        if head == folded:
            table.add_column(head, overflow="fold", ratio=1)
        else:
            table.add_column(head, no_wrap=True, overflow="ellipsis")
    return table


def _text(cell: str) -> Text:
    """Untrusted names are no markup."""
    from rich.text import Text

    return Text(clean(cell))
