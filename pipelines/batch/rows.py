"""One row of the batch's tables a fit: what its result says, as plain numbers and harmless text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipelines.report.stored import read_result
from pipelines.report.text import clean, stem

from .card import SUFFIX, read_card
from .job import Outcome
from .photograph import Photograph

CHANNELS = ("r", "g", "b")
PARTS = ("", "_sd", "_low90", "_high90")  # of each parameter: estimate, sd, ends of the 90 % interval
Cell = str | float | int | bool | None
Lobes = tuple[str, str, str]  # model, variant, diffuse lobe


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """`cells` by column; `fits` are all models' numbers of a photograph with a named material, for pooling.

    `page` and `card` are paths below the batch's folder, empty where there is none.
    """

    cells: Mapping[str, Cell]
    fits: Mapping[Lobes, FitNumbers] = field(default_factory=dict)
    page: str = ""
    card: str = ""

    def number(self, name: str) -> float | None:
        """A cell's number; None where there is none."""
        value = self.cells.get(name)
        return float(value) if isinstance(value, float | int) and not isinstance(value, bool) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class FitNumbers:
    """What pooling needs of one fit: elpd, and by parameter the estimates, sds and posterior-to-prior ratios."""

    elpd: float
    parameters: Mapping[str, tuple[tuple[float | None, ...], tuple[float | None, ...], tuple[float | None, ...], str]]


def row_of(photographs: Sequence[Photograph], place: str, outcome: Outcome, out_dir: Path) -> Row:
    """The row of a fit, from the files of its result, which are named after its first photograph."""
    name = stem(photographs[0].path.name)
    folder = out_dir / place
    there = bool(outcome.result)
    result = read_result(folder / f"{name}.json") if there else {}
    card = read_card(folder / f"{name}{SUFFIX}") if there else {}
    return Row(
        cells={**_ending(photographs, place, outcome), **_numbers(result, card)},
        fits=_fits(result) if photographs[0].material and outcome.status != "failed" else {},
        page=f"{place}/{name}.html" if there and (folder / f"{name}.html").is_file() else "",
        card=f"{place}/{name}{SUFFIX}" if card else "",
    )


def shown_name(photographs: Sequence[Photograph]) -> str:
    """The photographs as their user wrote them, harmless."""
    return clean(" + ".join("/".join(one.under) for one in photographs))


def _ending(photographs: Sequence[Photograph], place: str, outcome: Outcome) -> dict[str, Cell]:
    return {
        "photograph": shown_name(photographs),
        "place": place,
        "material": clean(photographs[0].material),
        "group": clean(photographs[0].group),
        "status": "failed" if outcome.status == "failed" else "done",
        "error": clean(outcome.error),
        "outlier": None,
    }


def _numbers(result: Mapping[str, Any], card: Mapping[str, Any]) -> dict[str, Cell]:
    if not result:
        return {}
    fits = result["fits"]
    best = fits[result["best"]] if fits and result["best"] is not None else None
    image, sphere = result["image"], result["sphere"]
    lights = result["lights"]
    fitted = (lights[0].get("fitted") or lights[0]) if lights else {}
    direction = fitted.get("direction") or (None, None, None)
    lead = result["elpd_difference"] or {}
    cells: dict[str, Cell] = {
        "flags": " ".join(dict.fromkeys([*result["flags"], *(best["flags"] if best else ())])),
        "camera": image["camera"],
        "sha256": image["sha256"],
        "width_px": image["width_px"],
        "height_px": image["height_px"],
        "scale": result["scale"],
        "centre_x_px": sphere["centre_px"][0],
        "centre_y_px": sphere["centre_px"][1],
        "radius_px": sphere["radius_px"],
        "lights": len(lights),
        "light_x": direction[0],
        "light_y": direction[1],
        "light_z": direction[2],
        "angle_deg": (result["separation"] or {}).get("angle_deg"),
        "alpha_ggx": card.get("alpha"),
        "strength_ggx": card.get("strength"),
        "swatch": card.get("swatch"),
    }
    if best is not None:
        cells |= {
            **dict(zip(("model", "variant", "diffuse"), lobes_of(best), strict=True)),
            "preferred": result["preferred"] == result["best"],
            "chi2_reduced": best["chi2_reduced"],
            "elpd": best["elpd"],
            "elpd_lead": lead.get("value"),
            "elpd_lead_sd": lead.get("sd"),
        }
        for parameter, numbers in best["parameters"].items():
            cells |= {} if _of_a_later_one(parameter) else _parameter(parameter, numbers)
    return cells


def lobes_of(fit: Mapping[str, Any]) -> Lobes:
    """What a fit was made with."""
    options = fit.get("variant")
    words = " ".join(f"{name}={one}" for name, one in sorted(options.items())) if isinstance(options, dict) else ""
    return clean(fit.get("model")), clean(words), clean(fit.get("diffuse"))


def _of_a_later_one(parameter: str) -> bool:
    """Whether it is a joint fit's second photograph's or a later one's alone: `pedestal_2`."""
    return parameter.rpartition("_")[2].isdecimal()


def _parameter(name: str, numbers: Mapping[str, Any]) -> dict[str, Cell]:
    low, high = numbers["interval_90"] or (None, None)
    parts = zip(PARTS, (numbers["estimate"], numbers["sd"], low, high), strict=True)
    cells: dict[str, Cell] = {}
    for part, value in parts:
        if isinstance(value, list):
            cells |= {f"{name}_{channel}{part}": one for channel, one in zip(CHANNELS, value, strict=True)}
        elif isinstance(numbers["estimate"], list):
            cells |= {f"{name}_{channel}{part}": value for channel in CHANNELS}
        else:
            cells[f"{name}{part}"] = value
    return cells


def _fits(result: Mapping[str, Any]) -> dict[Lobes, FitNumbers]:
    return {
        lobes_of(fit): FitNumbers(
            elpd=fit["elpd"],
            parameters={
                name: (
                    _tuple(numbers["estimate"]),
                    _tuple(numbers["sd"]),
                    _tuple(numbers["posterior_to_prior"]),
                    numbers["unit"],
                )
                for name, numbers in fit["parameters"].items()
                if not _of_a_later_one(name)
            },
        )
        for fit in result.get("fits", ())
        if fit["status"] == "converged" and fit["elpd"] is not None
    }


def _tuple(value: float | list[float | None] | None) -> tuple[float | None, ...]:
    return tuple(value) if isinstance(value, list) else (value,)
