"""48 photographs of a real glossy ball, each fitted alone: what is left, and do the intervals hold the others' answer?

python -m tests.benchmarks.ball_fits [EVERY [MODEL [RETURNED_SD]]]    of every second, third ... photograph

`gtr`, whose tail is a number of its own, or another model over `wolff`, the sphere given, the light's direction free
within a degree; `RETURNED_SD` of the light, 0 where nothing is said, may come back from the room. The residual is
told in three ways: over the samples that the fit uses, with those that glare brightens, and with the ball's edge,
whose radius and black background no fit looks at. An interval holds the others' consensus where it holds the median
of their estimates.
Needs the photographs (`FIT_MATERIAL_DATA`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.fit_material import fit_material
from tests.realdata import folder
from tests.validation.test_photographs import photograph, settings_of
from toolkit.flags import SampleFlag
from toolkit.geometry.sphere import surface
from toolkit.inference.gather import MIN_N_DOT_L, MIN_N_DOT_V
from toolkit.records import Estimate, Floats, MaterialReport
from toolkit.reflectance import LOBES

ASKED_RMS, ASKED_HELD = 0.026, (0.75, 0.98)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alone:
    """One photograph's fit: relative rms three ways, share of the ball's samples in glare, and its numbers."""

    used: float
    with_glare: float
    with_edge: float
    glare: float
    shape: dict[str, tuple[float, tuple[float, float]]]  # of each number of the specular lobe mean, 90 % interval
    albedo: tuple[Floats, Floats]  # (3,) and (2, 3), per unit of the light's intensity


def alone(index: int, model: str, returned_sd: float) -> Alone:
    """Fit one photograph."""
    settings = settings_of(index, fit={"models": [model], "diffuse": ["wolff"], "ess": 500})
    light = settings.light[0].model_copy(update={"returned_sd": returned_sd})
    settings = settings.model_copy(update={"light": (light,)})
    report = fit_material(photograph(index), settings)
    intensity = np.loadtxt(folder("diligent_ball") / "light_intensities.txt")[index]
    named = {one.name: one for one in report.fits[report.best].parameters}
    albedo = named["diffuse_albedo"]
    return Alone(
        **_left(report),
        shape={
            p.name: (float(np.asarray(named[p.name].estimate)), _interval(named[p.name]))
            for p in LOBES[model].parameters
        },
        albedo=(np.asarray(albedo.estimate) / intensity, np.asarray(_interval(albedo)) / intensity),
    )


def _interval(one: Estimate) -> tuple[float, float]:
    assert one.interval_90 is not None
    return one.interval_90


def _left(report: MaterialReport) -> dict[str, float]:
    layers, scene = report.layers, report.scene
    assert layers is not None
    row, column = np.indices(layers.diffuse.shape[:2]).reshape(2, -1)
    seen = surface(scene.camera, scene.sphere, layers.origin_px[0] + column, layers.origin_px[1] + row)
    towards = scene.lights[0].at(seen.normal)[0]
    lit = np.einsum("ni,ni->n", seen.normal, towards) > MIN_N_DOT_L
    inner = (seen.normal[:, 2] > MIN_N_DOT_V) & lit
    flags = np.stack([plane.flags for plane in report.image.planes], axis=-1)
    on_ball, fitted = np.isfinite(layers.model), inner.reshape(*layers.diffuse.shape[:2], 1)
    usable, glare = (flags & ~np.uint8(SampleFlag.GLARE)) == 0, (flags & SampleFlag.GLARE) > 0

    def rms(there: Floats) -> float:
        left, signal = layers.residual[there & on_ball], layers.photograph[there & on_ball]
        return float(np.sqrt(np.sum(left**2) / np.sum(signal**2)))

    return {
        "used": rms(usable & ~glare & fitted),
        "with_glare": rms(usable & fitted),
        "with_edge": rms(usable),
        "glare": float(np.count_nonzero(glare) / np.count_nonzero(on_ball)),
    }


def held(estimates: Sequence[float], intervals: Sequence[tuple[float, float]]) -> float:
    """The share of intervals that hold the median of the others' estimates."""
    others = [np.median(np.delete(estimates, i)) for i in range(len(estimates))]
    return float(np.mean([low <= median <= high for median, (low, high) in zip(others, intervals, strict=True)]))


def main(every: int = 1, model: str = "gtr", returned_sd: float = 0.0) -> None:
    """Print the figures."""
    found = [alone(index, model, returned_sd) for index in range(0, 48, every)]
    rms, glaring, edge, glare = (
        np.median([getattr(one, name) for one in found]) for name in ("used", "with_glare", "with_edge", "glare")
    )
    sys.stdout.write(
        f"{len(found)} photographs, {model} over wolff, medians: relative rms {rms:.4f} (asked {ASKED_RMS}), with "
        f"glare {glaring:.4f}, with the ball's edge {edge:.4f}; {100 * glare:.3f} % of samples in glare\n"
        f"90 % intervals that hold the others' median ({ASKED_HELD[0]} to {ASKED_HELD[1]} asked):\n"
    )
    numbers = {name: [one.shape[name] for one in found] for name in found[0].shape}
    numbers |= {
        f"albedo {letter}": [(one.albedo[0][c], tuple(one.albedo[1][:, c])) for one in found]
        for c, letter in enumerate("rgb")
    }
    for name, told in numbers.items():
        estimates, intervals = [estimate for estimate, _ in told], [interval for _, interval in told]
        low, high = np.median(intervals, axis=0)
        share, middle = held(estimates, intervals), np.median(estimates)
        sys.stdout.write(f"{name:10} {share:.3f}  median {middle:.4f} in {low:.4f} to {high:.4f}\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:3], *map(float, sys.argv[3:4]))
