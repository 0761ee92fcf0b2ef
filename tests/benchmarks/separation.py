"""How well colour alone separates, beside a public rival, a floor and the limit that theory sets.

python -m tests.benchmarks.separation [--quick]     prints a table and writes build/bench-separation.json

"Known shape" knows the sphere and the lamp's direction, and chooses between the main job's lobes itself; "lobe
withheld" may use lobes without a long tail only, where the truth has one.

PSNR of the diffuse layer over the sphere's pixels (peak: its largest true value) and the specular layer's rms error
over its rms, both by scikit-image. The limit is the Cramer-Rao bound of the two coefficients with both colours known.
The rival, fullseye 0.8, is told the light's colour as well; without it installed its columns stay empty.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.benchmarks.known_shape import by_shape
from tests.benchmarks.layer_score import NOISE, Layers, limit, photograph, score
from tests.benchmarks.separation_targets import SIGMAS, light_errors, targets, withheld
from tests.benchmarks.spheres import Picture, cases, measured
from toolkit.errors import BadInputError
from toolkit.separation import pool, separate

Method = Callable[[np.ndarray, Picture, float, np.ndarray], Layers]


def do_nothing(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> Layers:
    return values, np.zeros_like(values)


def colour_only(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> Layers:
    found = separate(
        values, variance=np.full(3, sd**2), usable=usable, on_sphere=truth.on_sphere, light_colour=truth.light_colour
    )
    return found.diffuse, found.specular


def pooled(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> Layers:
    found = pool(
        separate(
            values,
            variance=np.full(3, sd**2),
            usable=usable,
            on_sphere=truth.on_sphere,
            light_colour=truth.light_colour,
        )
    )
    return found.diffuse, found.specular


def known_shape(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> Layers:
    found = by_shape(values, truth, sd, usable)
    return found.diffuse, found.specular


def rival() -> Method | None:
    """Split by fullseye on the sphere's pixels, told the light's colour, its guards off where they refuse noise.

    None where it is not installed.
    """
    try:
        import fullseye
    except ImportError:
        return None

    def split(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> Layers:
        on = truth.on_sphere
        told = {"illuminant_rgb": truth.light_colour}
        try:
            found = fullseye.specular_diffuse_split(values[on][None], **told)
        except ValueError:
            free = {"max_rank_ratio": None, "max_negative_frac": None}
            found = fullseye.specular_diffuse_split(values[on][None], **told, **free)
        diffuse, specular = np.zeros_like(values), np.zeros_like(values)
        diffuse[on], specular[on] = found[0][0], found[1][0]
        return diffuse, specular

    return split


def attempt(method: Method, values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> dict:
    """Score of one method, or why it refused."""
    try:
        psnr, relative = score(truth, method(values, truth, sd, usable))
    except (BadInputError, ValueError) as error:
        return {"psnr_db": None, "relative_rms": None, "refused": str(error)}
    known = {"psnr_db": psnr, "relative_rms": relative}
    return {key: (None if np.isnan(value) else value) for key, value in known.items()}


def run(methods: dict[str, Method], quick: bool) -> list[dict]:
    """One row for every case, roughness and noise."""
    without_noise = {name: method for name, method in methods.items() if name != "known shape"}  # it weighs by noise
    by_noise = ((0.0, without_noise), (NOISE, methods))
    rows = []
    for sigma in SIGMAS[1:2] if quick else SIGMAS:
        rows += [_row(truth, sigma, noise, asked) for truth in cases(sigma) for noise, asked in by_noise]
    data = Path(os.environ.get("FIT_MATERIAL_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
    if (data / "merl_fits").is_dir():
        rows += [_row(truth, None, NOISE, methods) for truth in measured(data / "merl_fits")]
    return rows


def _of_the_ball() -> list[dict]:
    """The real ball's rows, where its photographs are."""
    import pytest

    from tests.benchmarks import ball_layers

    try:
        return ball_layers.rows()
    except pytest.skip.Exception as without:
        sys.stdout.write(f"{without}\n")
        return []


def _row(truth: Picture, sigma: float | None, noise: float, methods: dict[str, Method]) -> dict:
    values, sd, usable = photograph(truth, noise)
    best = limit(truth, sd)
    row: dict = {
        "case": truth.name,
        "sigma": sigma,
        "noise": noise,
        "limit": {"psnr_db": best[0], "relative_rms": best[1]},
    }
    row["methods"] = {name: attempt(method, values, truth, sd, usable) for name, method in methods.items()}
    row["flags"] = _flags(values, truth, sd, usable)
    return row


def _flags(values: np.ndarray, truth: Picture, sd: float, usable: np.ndarray) -> list[str]:
    found = separate(
        values, variance=np.full(3, sd**2), usable=usable, on_sphere=truth.on_sphere, light_colour=truth.light_colour
    )
    return [str(flag) for flag in found.flags]


def seconds(method: Method, repeats: int = 40) -> float:
    """Time of a split of 256 x 256 pixels: the fastest of many, as other work on the machine only ever adds."""
    truth = cases(0.2)[0]
    values, sd, usable = photograph(truth, NOISE)
    taken = []
    for _ in range(repeats):
        start = time.perf_counter()
        method(values, truth, sd, usable)
        taken.append(time.perf_counter() - start)
    return min(taken)


def table(rows: list[dict], names: list[str]) -> str:
    """A line a row: PSNR and relative rms of the limit and of every method."""

    def cell(entry: dict | None) -> str:
        if entry is None:
            return "-"
        if entry["psnr_db"] is None:
            return "refused" if "refused" in entry else "no answer"
        return f"{min(entry['psnr_db'], 199.9):6.1f} {min(entry['relative_rms'], 99):6.4f}"

    lines = [
        f"{'case':<22}{'sigma':>6}{'noise':>6}  " + "".join(f"{name:>16}" for name in ("limit", *names)) + "  flags"
    ]
    for row in rows:
        sigma = "" if row["sigma"] is None else f"{row['sigma']:g}"
        cells = [row["limit"], *(row["methods"].get(name) for name in names)]
        lines.append(
            f"{row['case']:<22}{sigma:>6}{row['noise']:>6g}  "
            + "".join(f"{cell(entry):>16}" for entry in cells)
            + f"  {', '.join(row['flags'])}"
        )
    return "\n".join(lines)


def _plain(value: object) -> object:
    """The same with None for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def main(arguments: list[str]) -> int:
    """Run, print, write; 1 where a target is missed."""
    methods: dict[str, Method] = {"do nothing": do_nothing}
    other = rival()
    if other is not None:
        methods["fullseye 0.8"] = other
    else:
        sys.stdout.write("fullseye is not installed (pip install 'fullseye==0.8.*'): no rival to compare with\n")
    methods |= {"colour only": colour_only, "pooled": pooled, "known shape": known_shape}
    rows = run(methods, quick="--quick" in arguments)
    few = {"known shape": 5}
    times = {name: seconds(method, few.get(name, 40)) for name, method in methods.items() if name != "do nothing"}
    lights, hidden = light_errors(), withheld()
    asked = targets(rows, lights, times, hidden) + _of_the_ball()
    sys.stdout.write(table(rows, list(methods)) + "\n\n")
    sys.stdout.write("".join(f"{name}: {taken * 1e3:.1f} ms\n" for name, taken in times.items()))
    for way in ("colour", "shape"):
        sys.stdout.write(f"light by {way}: {lights[way]:.2f} degrees off, {lights[f'{way}_stated']:.2f} stated\n")
    for row in hidden:
        sys.stdout.write(
            f"lobe withheld, sigma {row['sigma']:g}: {row['psnr_db']:.1f} dB, by {row['preferred']}; "
            f"colour alone {row['colour_psnr_db']:.1f} dB; {', '.join(row['flags'])}\n"
        )
    sys.stdout.write("\n")
    for each in asked:
        sys.stdout.write(
            f"{'met ' if each['met'] else 'MISSED'}  {each['what']}: {each['found']:.4g}, {each['asked']}\n"
        )
    out = Path("build/bench-separation.json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(
        json.dumps(
            _plain({"targets": asked, "seconds": times, "lights": lights, "withheld": hidden, "rows": rows}), indent=1
        )
    )
    return 0 if all(each["met"] for each in asked) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
