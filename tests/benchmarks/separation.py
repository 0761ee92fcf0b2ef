"""How well colour alone separates, beside a public rival, a floor and the limit that theory sets.

python -m tests.benchmarks.separation [--quick]     prints a table and writes build/bench-separation.json

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
from skimage.metrics import normalized_root_mse, peak_signal_noise_ratio

from tests.benchmarks.spheres import HUE, WARM, Picture, cases, gaussian_lobe, glossy, measured
from toolkit.errors import BadInputError
from toolkit.separation import best_illuminant, pool, separate

SIGMAS = (0.1, 0.2, 0.3)
NOISE = 0.01
SEED = 20
Layers = tuple[np.ndarray, np.ndarray]
Method = Callable[[np.ndarray, Picture, float, np.ndarray], Layers]


def photograph(truth: Picture, noise: float) -> tuple[np.ndarray, float, np.ndarray]:
    """The noisy picture, the sd of its samples and which of them are usable."""
    values = truth.radiance + noise * np.random.default_rng(SEED).standard_normal(truth.radiance.shape)
    usable = values < truth.clip
    sd = noise
    if truth.levels:
        values = np.round(np.clip(values, 0, 1) * truth.levels) / truth.levels
        sd = float(np.hypot(noise, 1 / truth.levels / np.sqrt(12)))
    return np.minimum(values, truth.clip), sd, usable


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


def limit(truth: Picture, sd: float) -> tuple[float, float]:
    """PSNR and relative rms that no unbiased split of single pixels beats; (0, inf) where colour tells nothing."""
    on = truth.on_sphere
    body = truth.diffuse[on].sum(axis=0)
    body, light = body / np.linalg.norm(body), truth.light_colour / np.linalg.norm(truth.light_colour)
    sin2 = 1 - float(body @ light) ** 2
    if sin2 < 1e-9:
        return 0.0, np.inf
    if sd == 0:
        return np.inf, 0.0
    mse = sd**2 / sin2 / 3
    peak, power = truth.diffuse[on].max(), np.mean(truth.specular[on] ** 2)
    return float(10 * np.log10(peak**2 / mse)), float(np.sqrt(mse / power))


def score(truth: Picture, layers: Layers) -> tuple[float, float]:
    """PSNR of the diffuse layer, dB, and relative rms error of the specular one; NaN where a layer says nothing."""
    on = truth.on_sphere
    if not all(np.all(np.isfinite(layer[on])) for layer in layers):
        return np.nan, np.nan
    true, found = truth.diffuse[on], np.asarray(layers[0], float)[on]
    with np.errstate(divide="ignore"):
        psnr = peak_signal_noise_ratio(true, found, data_range=float(true.max()))
    return float(psnr), float(normalized_root_mse(truth.specular[on], np.asarray(layers[1], float)[on]))


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
    rows = []
    for sigma in SIGMAS[1:2] if quick else SIGMAS:
        rows += [_row(truth, sigma, noise, methods) for truth in cases(sigma) for noise in (0.0, NOISE)]
    data = Path(os.environ.get("FIT_MATERIAL_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
    if (data / "merl_fits").is_dir():
        rows += [_row(truth, None, NOISE, methods) for truth in measured(data / "merl_fits")]
    return rows


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


def illuminant_error(noise: float = NOISE, sigma: float = 0.3) -> dict:
    """Degrees between the estimated light and the true one: one hue, warm light."""
    truth = glossy("warm light", gaussian_lobe(sigma), body=HUE, light=WARM)
    values, sd, usable = photograph(truth, noise)
    found = best_illuminant(values, variance=np.full(3, sd**2), usable=usable, on_sphere=truth.on_sphere)
    true = truth.light_colour / np.linalg.norm(truth.light_colour)
    error = float(np.degrees(np.arccos(np.clip(found.colour @ true, -1, 1))))
    return {"source": found.source, "error_deg": error, "stated_deg": found.sd_deg}


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


def targets(rows: list[dict], light: dict, time_s: float) -> list[dict]:
    """What was asked, what was found, and whether that is enough."""

    def all_of(case: str, noise: float, method: str) -> list[float]:
        chosen = [r for r in rows if r["case"] == case and r["noise"] == noise]
        return [r["methods"][method]["psnr_db"] or 0.0 for r in chosen]

    def below_limit(case: str, noise: float) -> float:
        chosen = [r for r in rows if r["case"] == case and r["noise"] == noise]
        return max(r["limit"]["psnr_db"] - (r["methods"]["colour only"]["psnr_db"] or 0.0) for r in chosen)

    found = [
        ("colour only, clean: worst sigma, dB", min(all_of("one hue", 0.0, "colour only")), ">=", 90.0),
        ("colour only, 1 %: dB below the limit, worst sigma", below_limit("one hue", NOISE), "<=", 0.4),
        ("pooled, 1 %: worst sigma, dB", min(all_of("one hue", NOISE, "pooled")), ">=", 42.0),
        (
            "3.8 % clipped, clean: all pixels, worst sigma, dB",
            min(all_of("3.8 % clipped", 0.0, "colour only")),
            ">=",
            50.0,
        ),
        ("12-bit: dB below the limit, worst sigma", below_limit("12-bit", 0.0), "<=", 1.0),
        ("light from one hue, warm, 1 %, sigma 0.3, degrees", light["error_deg"], "<=", 4.0),
        ("colour only, 256 x 256, seconds", time_s, "<=", 0.02),
    ]
    return [
        {"what": w, "found": f, "asked": f"{op} {a:g}", "met": f >= a if op == ">=" else f <= a}
        for w, f, op, a in found
    ]


def table(rows: list[dict], names: list[str]) -> str:
    """A line a row: PSNR and relative rms of the limit and of every method."""

    def cell(entry: dict) -> str:
        if entry["psnr_db"] is None:
            return "refused" if "refused" in entry else "no answer"
        return f"{min(entry['psnr_db'], 199.9):6.1f} {min(entry['relative_rms'], 99):6.4f}"

    lines = [
        f"{'case':<22}{'sigma':>6}{'noise':>6}  " + "".join(f"{name:>16}" for name in ("limit", *names)) + "  flags"
    ]
    for row in rows:
        sigma = "" if row["sigma"] is None else f"{row['sigma']:g}"
        cells = [row["limit"], *(row["methods"][name] for name in names)]
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
    methods |= {"colour only": colour_only, "pooled": pooled}
    rows = run(methods, quick="--quick" in arguments)
    times = {name: seconds(method) for name, method in methods.items() if name != "do nothing"}
    light = illuminant_error()
    asked = targets(rows, light, times["colour only"])
    sys.stdout.write(table(rows, list(methods)) + "\n\n")
    sys.stdout.write("".join(f"{name}: {taken * 1e3:.1f} ms\n" for name, taken in times.items()))
    sys.stdout.write(
        f"light: {light['error_deg']:.2f} degrees off, {light['stated_deg']:.2f} stated, {light['source']}\n\n"
    )
    for each in asked:
        sys.stdout.write(
            f"{'met ' if each['met'] else 'MISSED'}  {each['what']}: {each['found']:.4g}, {each['asked']}\n"
        )
    out = Path("build/bench-separation.json")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(_plain({"targets": asked, "seconds": times, "light": light, "rows": rows}), indent=1))
    return 0 if all(each["met"] for each in asked) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
