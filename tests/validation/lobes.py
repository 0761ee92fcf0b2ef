"""Photographs of small balls with every lobe for a truth, and how far a fit with the same lobe lands from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from synthetic.camera import exposure_for
from synthetic.materials import Material, material
from synthetic.render import render
from synthetic.scenes import direction, exposed
from tests.inference.ball import photograph, scene_of
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.estimates import named_draws, statistical_sds
from toolkit.inference.fit import fit
from toolkit.inference.infer import gather_for, infer
from toolkit.inference.model import Model
from toolkit.inference.problem import Optimum, Problem, pose
from toolkit.records import Floats, LinearImage, Noise, Scene
from toolkit.reflectance import LOBES

SIZE_PX = 96
ELECTRONS = {"interfaced-lambert": 60_000.0}  # at saturation; its index needs more than the others' numbers do
FEW_ELECTRONS = 4000.0
BODY, GLOSS, F0 = (0.45, 0.2, 0.08), 0.1, 0.04
UNDER = {"ggx": (0.25,)}  # the highlight over a diffuse lobe under trial
TRUTHS: dict[str, tuple[float, ...]] = {  # as sharp as so small a ball still shows, far from the ranges' ends
    "mirror": (0.12,),
    "phong": (12.0,),
    "blinn-phong": (40.0,),
    "lafortune": (12.0, 0.95),
    "gtr": (0.25, 2.2),
    "hazy-ggx": (0.12, 0.4, 3.0),
    "oren-nayar": (0.35,),
    "wolff": (1.5,),
    "interfaced-lambert": (1.5, 0.2),
}

TWO_LIGHTS = ("lafortune",)  # under a single far light its axis ratio and its colour are one number
WITHIN_90 = 1.6449  # sd


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Landing:
    """Of fits (n, numbers): z = (estimate - truth) / sd, and whether the 90 % intervals hold the truth."""

    z: Floats
    held: Floats

    @classmethod
    def of(cls, z: Iterable[Iterable[Floats]], held: Iterable[Iterable[Floats]]) -> Landing:
        """From each fit's numbers and colours."""
        both = (np.array([np.concatenate([np.ravel(n) for n in fit]) for fit in fits]) for fits in (z, held))
        return cls(**dict(zip(("z", "held"), both, strict=True)))


def truth_of(name: str) -> tuple[float, ...]:
    """The lobe's shape numbers in the trial; 0.2 rad or so where the table has none."""
    return TRUTHS.get(name, tuple(float(np.clip(0.2, p.low, p.high)) for p in LOBES[name].parameters))


@cache
def ball(name: str) -> tuple[Material, Floats, Scene]:
    """The material, the noise-free radiance with its highlight at 0.8, and the scene in its units."""
    lobe = LOBES[name]
    model, diffuse = (name, "lambert") if lobe.kind == "specular" else ("ggx", name)
    gloss = {"specular_f0": F0} if LOBES[model].fresnel else {"specular_albedo": GLOSS}
    names = [p.name for part in (LOBES[model], LOBES[diffuse]) for p in part.parameters]
    numbers = truth_of(name) if lobe.kind == "specular" else UNDER["ggx"] + truth_of(name)
    made = material(model, {**dict(zip(names, numbers, strict=True)), "diffuse_albedo": BODY, **gloss}, diffuse=diffuse)
    scene = scene_of(SIZE_PX)
    if name in TWO_LIGHTS:
        other = DirectionalLight(direction=direction(75.0, 200.0), irradiance=(3.0, 3.0, 3.0))
        scene = replace(scene, lights=(*scene.lights, other))
    picture = render(scene, made, width_px=SIZE_PX, height_px=SIZE_PX, supersample=8)
    factor = exposure_for(picture, highlight=0.8)
    return made, picture.radiance() * factor, exposed(scene, factor)


def at_the_optimum(name: str, seeds: Iterable[int]) -> Landing:
    """Landings by the optimum and its curvature; the first seed searches the whole range, the others begin there."""
    made, _, scene = ball(name)
    truth = {**made.shape, **made.colours}
    start: Optimum | None = None
    z = []
    for seed in seeds:
        start = fit(_problem(made, scene, _photograph(name, seed)), start=start)
        mode, sd = named_draws(start, start.u[None], start.x[None]), statistical_sds(start)
        z.append([(mode[key][0] - value) / sd[key] for key, value in truth.items()])
    return Landing.of(z, [[np.abs(part) < WITHIN_90 for part in one] for one in z])


def by_posterior(name: str, seeds: Iterable[int]) -> Landing:
    """Landings by the whole inference: search, posterior mean, sd and interval."""
    made, _, scene = ball(name)
    truth = {**made.shape, **made.colours}
    z, held = [], []
    for seed in seeds:
        image = _photograph(name, seed)
        cells, model = gather_for(image, scene), Model.named(made.model, made.diffuse)
        found = infer(image, scene, cells, model, seed=seed, fixed=("all",), discrepancy=False, effective=300)
        known = [(e, truth[e.name]) for e in found.parameters if e.name in truth]
        assert len(known) == len(truth)
        z.append([(e.estimate - value) / e.sd for e, value in known])
        held.append([(e.interval_90[0] <= value) & (value <= e.interval_90[1]) for e, value in known])
    return Landing.of(z, held)


def _photograph(name: str, seed: int) -> LinearImage:
    """Each lobe has noise of its own."""
    electrons = ELECTRONS.get(name, FEW_ELECTRONS)
    noise = Noise(gain=np.full(3, 1.0 / electrons), read=np.full(3, 3.0 / electrons), source="given")
    return photograph(ball(name)[1], seed=1000 * sorted(LOBES).index(name) + seed, noise=noise, mosaic=False)


def _problem(made: Material, scene: Scene, image: LinearImage) -> Problem:
    return pose(Model.named(made.model, made.diffuse), scene, gather_for(image, scene), image.noise)
