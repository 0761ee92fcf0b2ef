"""Twenty-four materials, each photographed again and again: how far answers scatter, over the least possible.

python -m tests.validation.scatter     prints the table of docs/validation.md; ten minutes

A material is rendered once; every draw has its own noise, black level and, where the calibration is free, its own
errors of light and sphere, all from what the fit is told of them. The bound is that of `bound.py`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.validate.efficiency import efficiency
from synthetic.materials import Material, material
from synthetic.render import render
from synthetic.scenes import as_measured, direction, sphere_in
from tests.inference.ball import photograph
from tests.validation.bound import bound_sds
from toolkit.geometry.lights import DirectionalLight
from toolkit.inference.estimates import UNIFORM_SD, named_draws
from toolkit.inference.infer import gather_for
from toolkit.inference.model import Model
from toolkit.inference.nuisances import Shifts, shifts_of
from toolkit.inference.priors import PEDESTAL_SD
from toolkit.inference.problem import pose
from toolkit.inference.settle import fit_with_shifts
from toolkit.inference.views import signal_scale
from toolkit.records import Floats, Noise, Scene

Line = dict[str, Any]

RADIUS_PX, SIDE_PX = 56.0, 130
DRAWS = 200
NOISELESS = Noise(gain=np.zeros(3), read=np.zeros(3), source="given")
RED, OCHRE, BLUE, GREY, DARK = (0.5, 0.15, 0.1), (0.45, 0.3, 0.12), (0.1, 0.2, 0.5), (0.5, 0.5, 0.5), (0.06, 0.05, 0.04)
GOLD = (0.2, 0.14, 0.06)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ball:
    """A material under a light so far off the axis, so many electrons at a radiance of 1; is the calibration free?"""

    model: str
    shape: tuple[float, ...]
    albedo: tuple[float, float, float]
    gloss: float | tuple[float, float, float]
    light_deg: float
    electrons: float = 20_000.0
    free: bool = False
    diffuse: str = "lambert"

    @property
    def name(self) -> str:
        """How the table calls it."""
        body = "" if self.diffuse == "lambert" else f" over {self.diffuse}"
        return f"{self.model}{body} {', '.join(f'{number:g}' for number in self.shape)}"

    @cached_property
    def fitted(self) -> Model:
        """What it is made of, and fitted by."""
        return Model.named(self.model, self.diffuse)

    @cached_property
    def made(self) -> Material:
        """Its material."""
        gloss = "specular_f0" if self.fitted.specular.fresnel else "specular_albedo"
        shape = {p.name: value for p, value in zip(self.fitted.parameters, self.shape, strict=True)}
        return material(self.model, {**shape, "diffuse_albedo": self.albedo, gloss: self.gloss}, diffuse=self.diffuse)

    @cached_property
    def scene(self) -> Scene:
        """As it is; light and sphere are told wrongly by as much as it states."""
        light = DirectionalLight(
            direction=direction(self.light_deg, 7.0 * self.light_deg), direction_sd_deg=0.3, irradiance=(3.0, 3.0, 3.0)
        )
        sphere = {"radius_px": RADIUS_PX, "offset_px": (0.3, -0.4), "centre_sd_px": 0.1, "radius_sd_px": 0.1}
        return sphere_in(SIDE_PX, SIDE_PX, lights=(light,), **sphere)

    @cached_property
    def radiance(self) -> Floats:
        """Without noise."""
        return render(self.scene, self.made, width_px=SIDE_PX, height_px=SIDE_PX).radiance()

    @property
    def noise(self) -> Noise:
        """Of its samples."""
        return Noise(gain=np.full(3, 1.0 / self.electrons), read=np.full(3, 8.0 / self.electrons), source="given")

    @cached_property
    def pedestal_sd(self) -> float:
        """What the fit takes for the sd of the black level's error."""
        still = photograph(self.radiance, seed=0, noise=NOISELESS)
        return PEDESTAL_SD * signal_scale(gather_for(still, self.scene))

    @property
    def fixed(self) -> tuple[str, ...]:
        """The calibration that is exactly known; a light told as far is far."""
        return ("distance",) if self.free else ("all",)

    @property
    def shifts(self) -> Shifts:
        """The calibration that is not."""
        return shifts_of(self.scene, self.fixed)

    @cached_property
    def bound(self) -> dict[str, Floats]:
        """Smallest sds."""
        return bound_sds(self.scene, self.made, self.noise, self.shifts, side_px=SIDE_PX, pedestal_sd=self.pedestal_sd)


BALLS = (
    Ball(model="torrance-sparrow", shape=(0.06,), albedo=RED, gloss=0.04, light_deg=20.0),
    Ball(model="torrance-sparrow", shape=(0.15,), albedo=BLUE, gloss=0.08, light_deg=45.0, free=True),
    Ball(model="torrance-sparrow", shape=(0.3,), albedo=DARK, gloss=GOLD, light_deg=35.0),
    Ball(model="phong", shape=(12.0,), albedo=OCHRE, gloss=0.1, light_deg=30.0),
    Ball(model="phong", shape=(60.0,), albedo=BLUE, gloss=0.05, light_deg=50.0, free=True),
    Ball(model="phong", shape=(200.0,), albedo=DARK, gloss=0.02, light_deg=15.0),
    Ball(model="blinn-phong", shape=(15.0,), albedo=GREY, gloss=0.15, light_deg=40.0, free=True),
    Ball(model="blinn-phong", shape=(80.0,), albedo=RED, gloss=0.05, light_deg=25.0),
    Ball(model="blinn-phong", shape=(300.0,), albedo=OCHRE, gloss=0.1, light_deg=60.0, free=True),
    Ball(model="beckmann", shape=(0.08,), albedo=GREY, gloss=0.04, light_deg=30.0, free=True),
    Ball(model="beckmann", shape=(0.2,), albedo=RED, gloss=0.1, light_deg=55.0),
    Ball(model="beckmann", shape=(0.4,), albedo=BLUE, gloss=0.15, light_deg=20.0, electrons=60_000.0),
    Ball(model="ggx", shape=(0.08,), albedo=DARK, gloss=0.04, light_deg=40.0),
    Ball(model="ggx", shape=(0.15,), albedo=OCHRE, gloss=0.06, light_deg=25.0, free=True),
    Ball(model="ggx", shape=(0.3,), albedo=GREY, gloss=GOLD, light_deg=50.0),
    Ball(model="ggx", shape=(0.45,), albedo=RED, gloss=0.15, light_deg=35.0, electrons=60_000.0, free=True),
    Ball(model="beckmann", diffuse="oren-nayar", shape=(0.1, 0.3), albedo=OCHRE, gloss=0.04, light_deg=50.0),
    Ball(model="beckmann", diffuse="oren-nayar", shape=(0.2, 0.5), albedo=GREY, gloss=0.08, light_deg=35.0, free=True),
    Ball(model="beckmann", diffuse="oren-nayar", shape=(0.3, 0.4), albedo=RED, gloss=0.1, light_deg=60.0),
    Ball(model="beckmann", diffuse="oren-nayar", shape=(0.15, 0.6), albedo=BLUE, gloss=0.05, light_deg=45.0, free=True),
    Ball(model="torrance-sparrow", diffuse="wolff", shape=(0.1, 1.5), albedo=GREY, gloss=0.04, light_deg=45.0),
    Ball(
        model="torrance-sparrow",
        diffuse="wolff",
        shape=(0.2, 1.6),
        albedo=GREY,
        gloss=0.06,
        light_deg=60.0,
        electrons=200_000.0,
        free=True,
    ),
    Ball(
        model="torrance-sparrow",
        diffuse="wolff",
        shape=(0.08, 1.55),
        albedo=OCHRE,
        gloss=0.05,
        light_deg=30.0,
        electrons=200_000.0,
    ),
    Ball(
        model="torrance-sparrow",
        diffuse="wolff",
        shape=(0.15, 1.45),
        albedo=BLUE,
        gloss=0.08,
        light_deg=50.0,
        electrons=200_000.0,
    ),
)


def line_of(ball: Ball, draw: int) -> Line:
    """One draw's numbers beside truth and bound, as a line of a validation's record."""
    rng = np.random.default_rng([draw, BALLS.index(ball)])
    told = as_measured(ball.scene, rng) if ball.free else ball.scene
    black = ball.pedestal_sd * rng.standard_normal(3)
    image = photograph(ball.radiance + black, seed=int(rng.integers(2**31)), noise=ball.noise)
    problem = pose(ball.fitted, told, gather_for(image, told), ball.noise)
    optimum, _ = fit_with_shifts(problem, shifts_of(told, ball.fixed))
    found = named_draws(optimum, optimum.u[None], optimum.x[None])
    numbers: list[Line] = []
    for p in ball.fitted.parameters:
        truth, (bound,) = ball.made.shape[p.name], ball.bound[p.name]
        width = truth * np.log(p.high / p.low) if p.log else p.high - p.low
        numbers.append(_number(p.name, None, truth, found[p.name][0], bound, bound / (UNIFORM_SD * width)))
    for name, truths in ball.made.colours.items():
        each = zip(truths, found[name][0], ball.bound[name], strict=True)
        numbers += [_number(name, channel, *values, None) for channel, values in enumerate(each)]
    return {"model": ball.model, "diffuse": ball.diffuse, "status": optimum.status, "numbers": numbers}


def _number(name: str, channel: int | None, truth: float, mean: float, bound: float, to_prior: float | None) -> Line:
    return {
        "name": name,
        "channel": channel,
        "truth": float(truth),
        "mean": float(mean),
        "bound_sd": float(bound),
        "bound_to_prior": to_prior,
    }


def scattered(ball: Ball, draws: Iterable[int]) -> list[Line]:
    """The lines of a material's draws."""
    return [line_of(ball, draw) for draw in draws]


def main() -> None:
    """The tables, as Markdown."""
    lines = {ball: scattered(ball, range(DRAWS)) for ball in BALLS}
    _tell("| material | calibration | rmse over the bound |", "|---|---|---|")
    for ball, mine in lines.items():
        _tell(f"| {ball.name} | {'free' if ball.free else 'known'} | {efficiency(mine)[0]:.3f} |")
    every = [line for mine in lines.values() for line in mine]
    _tell("| parameter | materials | rmse over the bound |", "|---|---|---|")
    for name in sorted({n["name"] for line in every for n in line["numbers"]}):
        ratio, chance, count = efficiency(every, name)
        _tell(f"| `{name}` | {count // DRAWS} | {ratio:.3f} ± {chance:.3f} |")


def _tell(*rows: str) -> None:
    sys.stdout.write("".join(f"{row}\n" for row in rows))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
