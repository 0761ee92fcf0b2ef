"""Simulation-based calibration: truths drawn from a fit's own prior, photographs of them, ranks among the draws.

python -m tests.validation.simulations FILE     prints the table of docs/validation.md; an hour or two; what FILE has
                                                is not done again

Where truths come from the prior and photographs from the model, a truth stands anywhere among its posterior draws
with the same chance (Cook, Gelman & Rubin 2006; Talts et al. 2018). So it does within a box of the prior, if truths and
draws outside are left out: colours, whose prior is even and has no end, have one here, and shapes begin where a ball of
this size shows them. All else is the prior itself: shapes even in their searched coordinate up to their range's end,
albedos and F0 from 0 on, black level, the light's direction and nearness, the sphere's place and radius.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from pipelines.validate.design import MODELS, SHAPES
from pipelines.validate.score import Score, score
from synthetic.materials import Material, material
from synthetic.render import render
from synthetic.scenes import direction, sphere_in
from tests.inference.ball import photograph
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifted, shifts_of
from toolkit.inference.priors import PEDESTAL_SD
from toolkit.inference.views import signal_scale
from toolkit.records import Fit, Floats, LinearImage, Noise, Scene
from toolkit.reflectance.lobe import Parameter

Line = dict[str, Any]
Pair = tuple[str, str]

MOST = {"diffuse_albedo": 0.8, "specular_albedo": 0.2, "specular_f0": 0.2}  # where the colours' box ends
IRRADIANCE = (3.0, 3.0, 3.0)  # told, and the same for every truth: an exposure by its highlight would give it away
DRAWS = 299  # of some 4,000, so far apart along the chains that they are independent; ranks of 60 places lie between
LEAST_SD = 1e-9  # where all draws lie on an end of a range
NOISELESS = Noise(gain=np.zeros(3), read=np.zeros(3), source="given")
COUNTS = {False: 1000, True: 400}  # simulations of a model, without discrepancy and with it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """A photograph of a truth, by the names of a result, in a scene that lies aside of the one told by `shifts`."""

    model: Model
    told: Scene
    image: LinearImage
    truth: Mapping[str, Floats]
    shifts: Mapping[str, float]


def simulate(pair: Pair, seed: int) -> Simulation:
    """Scene and noise of any kind, then a truth from their prior and its photograph."""
    model, rng = Model.named(*pair), np.random.default_rng([seed, MODELS.index(pair)])
    told, noise = _scene(rng), _noise(rng)
    free = shifts_of(told)
    moved = rng.multivariate_normal(np.zeros(len(free.names)), free.covariance)
    made, side = _material(model, rng), 2 * int(np.ceil(1.15 * told.sphere.radius_px))
    radiance = render(shifted(told, free, moved), made, width_px=side, height_px=side).radiance()
    still = photograph(radiance, seed=0, noise=NOISELESS)
    black = PEDESTAL_SD * signal_scale(gather_for(still, told)) * rng.standard_normal(3)
    shape = {name: np.atleast_1d(value) for name, value in made.shape.items()}
    return Simulation(
        model=model,
        told=told,
        image=photograph(radiance + black, seed=int(rng.integers(2**31)), noise=noise),
        truth={**shape, **made.colours, "pedestal": black},
        shifts=dict(zip(free.names, moved.tolist(), strict=True)),
    )


def line_of(pair: Pair, seed: int, *, discrepancy: bool) -> Line:
    """A simulation's numbers beside their posterior, as a line of a validation's record."""
    of = simulate(pair, seed)
    fit = infer(of.image, of.told, gather_for(of.image, of.told), of.model, seed=seed, discrepancy=discrepancy)
    return {
        "number": seed,
        "model": pair[0],
        "diffuse": pair[1],
        "discrepancy": discrepancy,
        "status": "done",
        "broken": "",
        "flags": sorted(fit.flags),
        "numbers": [*_of_draws(of, fit), *_of_shifts(of, fit)],
        "psnr_db": None,
        "seconds": {},
    }


def _scene(rng: np.random.Generator) -> Scene:
    radius_px, place_sd_px = float(rng.uniform(40.0, 64.0)), float(rng.uniform(0.05, 0.3))
    light = DirectionalLight(
        direction=direction(rng.uniform(10.0, 70.0), rng.uniform(0.0, 360.0)),
        direction_sd_deg=float(rng.uniform(0.1, 1.0)),
        irradiance=IRRADIANCE,
    )
    x, y = rng.uniform(-1.0, 1.0, 2)
    side = 2 * int(np.ceil(1.15 * radius_px))
    return sphere_in(
        side,
        side,
        radius_px=radius_px,
        lights=(light,),
        offset_px=(float(x), float(y)),
        centre_sd_px=place_sd_px,
        radius_sd_px=place_sd_px,
    )


def _noise(rng: np.random.Generator) -> Noise:
    electrons = 10.0 ** rng.uniform(3.5, 4.8)
    return Noise(gain=np.full(3, 1.0 / electrons), read=np.full(3, 8.0 / electrons), source="given")


def _range(of: Parameter) -> tuple[float, float]:
    """From the sharpest lobe that a ball of this size shows to the prior's other end."""
    low, high = SHAPES[of.name]
    return (of.low, high) if of.name == "shininess" else (low, of.high)  # the higher, the sharper


def _material(model: Model, rng: np.random.Generator) -> Material:
    gloss = "specular_f0" if model.specular.fresnel else "specular_albedo"
    numbers: dict[str, Any] = {name: rng.uniform(0.0, MOST[name], 3) for name in ("diffuse_albedo", gloss)}
    for of in model.parameters:
        low, high = _range(of)
        numbers[of.name] = float(np.exp(rng.uniform(*np.log([low, high]))) if of.log else rng.uniform(low, high))
    return material(model.specular.name, numbers, diffuse=model.diffuse.name)


def _of_draws(of: Simulation, fit: Fit) -> Iterator[Line]:
    """Ranks among the draws that lie in the box which the truths are from."""
    draws = {name: fit.draws[name].reshape(-1, len(true)) for name, true in of.truth.items()}
    box = {p.name: _range(p) for p in of.model.parameters} | {name: (0.0, most) for name, most in MOST.items()}
    inside = [((low <= draws[n]) & (draws[n] <= high)).all(axis=1) for n, (low, high) in box.items() if n in draws]
    kept = np.flatnonzero(np.all(inside, axis=0))
    kept = kept if len(kept) else np.arange(len(inside[0]))  # all are elsewhere, and the truth at their end
    kept = kept[np.linspace(0, len(kept) - 1, min(DRAWS, len(kept))).round().astype(int)]
    for name, true in of.truth.items():
        for channel, value in enumerate(true):
            mine = draws[name][kept, channel]
            rank = (np.count_nonzero(mine < value) + 0.5) / (len(mine) + 1)
            told = float(mine.mean()), max(float(mine.std()), LEAST_SD)
            yield _number(name, channel if len(true) > 1 else None, value, *told, rank)


def _of_shifts(of: Simulation, fit: Fit) -> Iterator[Line]:
    """Calibration has no draws in a result, but a mean and an sd: ranks among as many draws of a Gaussian."""
    for name, true in of.shifts.items():
        mean, sd = fit.nuisances[name]
        below = min(int(norm.cdf((true - mean) / sd) * (DRAWS + 1)), DRAWS)
        yield _number(name, None, true, mean, sd, (below + 0.5) / (DRAWS + 1))


def _number(name: str, channel: int | None, truth: float, mean: float, sd: float, rank: float) -> Line:
    return {
        "name": name,
        "channel": channel,
        "truth": float(truth),
        "mean": mean,
        "sd": sd,
        "rank": float(rank),
        "bound_sd": None,
        "bound_to_prior": None,
    }


def simulated(pair: Pair, *, discrepancy: bool) -> list[Line]:
    """The lines of one model."""
    return [line_of(pair, seed, discrepancy=discrepancy) for seed in range(COUNTS[discrepancy])]


def least_even(found: Score, models: int = len(MODELS)) -> tuple[float, str]:
    """Of the least even histogram: the chance of such among even ranks of `models` models, by Bonferroni; its name."""
    group = min(found.groups, key=lambda group: group.rank_p)
    return min(models * len(found.groups) * group.rank_p, 1.0), group.name


def _all(path: Path) -> list[Line]:
    """Every line, those that the file lacks made and kept there."""
    done = {_key(line): line for line in map(json.loads, path.read_text().splitlines())} if path.exists() else {}
    with path.open("a") as stream:
        for seed, pair, discrepancy in product(range(max(COUNTS.values())), MODELS, COUNTS):
            if seed < COUNTS[discrepancy] and (*pair, seed, discrepancy) not in done:
                line = line_of(pair, seed, discrepancy=discrepancy)
                done[_key(line)] = line
                stream.write(json.dumps(line) + "\n")
                stream.flush()
    return list(done.values())


def _key(line: Line) -> tuple[str, str, int, bool]:
    return line["model"], line["diffuse"], line["number"], line["discrepancy"]


def table(lines: Sequence[Line]) -> Iterator[str]:
    """The rows, as Markdown."""
    yield "| model | simulations | 90 % held | with discrepancy | least even ranks | chance |"
    yield "|---|---|---|---|---|---|"
    for pair in MODELS:
        mine = [line for line in lines if (line["model"], line["diffuse"]) == pair]
        off, on = (score([line for line in mine if line["discrepancy"] == discrepancy]) for discrepancy in COUNTS)
        (chance, name), held = least_even(off), [f"{100.0 * of.all.coverage[0.9]:.1f} %" for of in (off, on)]
        counts = f"{off.renders}, {on.renders}"
        yield f"| {off.models[0].name} | {counts} | {' | '.join(held)} | `{name}` | {chance:.2g} |"


if __name__ == "__main__":
    sys.stdout.write("".join(f"{row}\n" for row in table(_all(Path(sys.argv[1])))))
