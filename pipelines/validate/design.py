"""What is rendered: materials, lights, cameras and exposures, spread evenly over what users meet.

A Latin hypercube (McKay, Beckman & Conover 1979): every number's range is cut into as many slices as there are
renders, and each slice is used once, so that even a small set reaches all corners of every single number.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from pipelines.settings import DEFAULT_SPHERE_SD_PX
from toolkit.inference.gather import DIRECTION_SD_DEG
from toolkit.reflectance import LOBES

Preset = Literal["quick", "standard", "full"]
RENDERS: dict[Preset, int] = {"quick": 112, "standard": 1050, "full": 5250}
STRESS_REPEATS: dict[Preset, int] = {"quick": 2, "standard": 12, "full": 48}
MODELS = (  # the main job's five over Lambert, and its other two bodies
    ("torrance-sparrow", "lambert"),
    ("phong", "lambert"),
    ("blinn-phong", "lambert"),
    ("beckmann", "lambert"),
    ("ggx", "lambert"),
    ("beckmann", "oren-nayar"),
    ("torrance-sparrow", "wolff"),
)
SHAPES = {  # range of each shape number; a highlight of 0.05 rad is two pixels wide on the smallest ball; the diffuse
    # ones, which a photograph may hardly tell, have their prior's own: only so are their ranks even
    "roughness_rad": (0.05, 0.45),
    "alpha": (0.06, 0.5),
    "shininess": (5.0, 400.0),
    "diffuse_roughness_rad": (0.0, 0.8),
    "diffuse_index": (1.3, 1.8),
}
RANGES = {  # of the scene; all but those in LINEAR are spread evenly in their logarithm
    "albedo": (0.08, 0.8),
    "red": (0.35, 1.0),
    "green": (0.35, 1.0),
    "blue": (0.35, 1.0),
    "specular": (0.02, 0.2),
    "light_off_axis_deg": (8.0, 80.0),
    "light_around_deg": (0.0, 360.0),
    "light_sd_deg": (0.05, 1.0),
    "radius_px": (48.0, 128.0),
    "place_sd_px": (0.03, 0.5),
    "electrons": (3_000.0, 60_000.0),
    "read_electrons": (2.0, 12.0),
    "highlight": (0.3, 0.95),
    "black_error": (0.0, 1.0),  # a quantile of what a fit allows for
}
LINEAR = frozenset(
    {
        "red",
        "green",
        "blue",
        "light_off_axis_deg",
        "light_around_deg",
        "highlight",
        "black_error",
        "diffuse_roughness_rad",
        "diffuse_index",
    }
)
VARIABLES = (  # that z is shown against
    "light_off_axis_deg",
    "light_sd_deg",
    "radius_px",
    "place_sd_px",
    "electrons",
    "highlight",
    "albedo",
    "specular",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One render: its material by a scene file's names, its scene by the names of RANGES, and what is broken."""

    number: int
    seed: int
    model: str
    diffuse: str
    parameters: Mapping[str, float | Sequence[float]]
    scene: Mapping[str, float]
    setup: Mapping[str, Any] | None = None  # a scene file's tables, in place of RANGES' numbers
    broken: str = ""  # an assumption's name; "" for a render that keeps them all
    amount: float = 0.0

    @property
    def name(self) -> str:
        """How the page and the kept files call it."""
        return f"trial-{self.number:05d}"


def designed(preset: Preset, *, seed: int = 0) -> tuple[Trial, ...]:
    """The preset's trials: clean ones first, then each assumption broken by each of its amounts."""
    clean = hypercube(RENDERS[preset], seed=seed)
    return clean + stressed(STRESS_REPEATS[preset], first=len(clean), seed=seed + 1)


def hypercube(count: int, *, first: int = 0, seed: int = 0) -> tuple[Trial, ...]:
    """`count` clean trials, the models in turn."""
    from scipy.stats.qmc import LatinHypercube

    shapes = max(len(_shape_names(*pair)) for pair in MODELS)
    unit = LatinHypercube(d=len(RANGES) + shapes, rng=np.random.default_rng(seed)).random(count)
    return tuple(_trial(first + i, seed, row) for i, row in enumerate(unit))


def stressed(repeats: int, *, first: int, seed: int) -> tuple[Trial, ...]:
    """Every assumption broken by each of its amounts, on `repeats` balls each: the same balls for all of them."""
    from .broken import ASSUMPTIONS

    balls = hypercube(repeats, seed=seed)
    rows = [(name, amount) for name, assumption in ASSUMPTIONS.items() for amount in assumption.amounts]
    found: list[Trial] = []
    for name, amount in rows:
        for ball in balls:
            found.append(_broken(ball, first + len(found), name, amount))
    return tuple(found)


def fingerprint(trials: Sequence[Trial]) -> str:
    """A hash of the trials themselves: what a resumed run must agree with."""
    text = json.dumps([asdict(trial) for trial in trials], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _broken(ball: Trial, number: int, name: str, amount: float) -> Trial:
    """The ball with an assumption broken; its user says nothing of how well light and sphere are known."""
    unsaid = {"light_sd_deg": DIRECTION_SD_DEG, "place_sd_px": DEFAULT_SPHERE_SD_PX}
    values = asdict(ball) | {"number": number, "broken": name, "amount": amount, "scene": {**ball.scene, **unsaid}}
    return Trial(**values)


def _trial(number: int, seed: int, unit: np.ndarray[Any, Any]) -> Trial:
    model, diffuse = MODELS[number % len(MODELS)]
    scene = {
        name: _between(u, low, high, log=name not in LINEAR)
        for u, (name, (low, high)) in zip(unit, RANGES.items(), strict=False)
    }
    names = _shape_names(model, diffuse)
    shape = {
        name: _between(u, *SHAPES[name], log=name not in LINEAR)
        for u, name in zip(unit[len(RANGES) :], names, strict=False)
    }
    hue = [scene["albedo"] * scene[channel] for channel in ("red", "green", "blue")]
    specular = "specular_f0" if LOBES[model].fresnel else "specular_albedo"
    return Trial(
        number=number,
        seed=seed * 1_000_003 + number,
        model=model,
        diffuse=diffuse,
        parameters=shape | {"diffuse_albedo": hue, specular: scene["specular"]},
        scene=scene,
    )


def _shape_names(model: str, diffuse: str) -> list[str]:
    return [p.name for name in (model, diffuse) for p in LOBES[name].parameters]


def _between(u: float, low: float, high: float, *, log: bool) -> float:
    value = low * (high / low) ** u if log else low + (high - low) * u
    return float(f"{value:.6g}")  # short in a scene file, and the same on every machine
