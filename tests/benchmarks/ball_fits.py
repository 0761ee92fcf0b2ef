"""48 photographs of a real glossy ball, each fitted alone: what is left, and do the intervals hold the others' answer?

python -m tests.benchmarks.ball_fits [EVERY]    prints the figures; of every second, third ... photograph

`ggx` over `wolff`, the sphere given, the light's direction free within a degree. The residual is told in three ways:
over the samples that the fit uses, with those that glare brightens, and with the ball's edge, whose radius and black
background no fit looks at. An interval holds the others' consensus where it holds the median of their estimates.
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

FIT = {"models": ["ggx"], "diffuse": ["wolff"], "ess": 500}
ASKED_RMS, ASKED_HELD = 0.026, (0.75, 0.98)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alone:
    """One photograph's fit: relative rms three ways, share of the ball's samples in glare, and its numbers."""

    used: float
    with_glare: float
    with_edge: float
    glare: float
    alpha: tuple[float, tuple[float, float]]  # posterior mean, 90 % interval
    albedo: tuple[Floats, Floats]  # (3,) and (2, 3), per unit of the light's intensity


def alone(index: int) -> Alone:
    """Fit one photograph."""
    report = fit_material(photograph(index), settings_of(index, fit=FIT))
    intensity = np.loadtxt(folder("diligent_ball") / "light_intensities.txt")[index]
    named = {one.name: one for one in report.fits[report.best].parameters}
    alpha, albedo = named["alpha"], named["diffuse_albedo"]
    return Alone(
        **_left(report),
        alpha=(float(np.asarray(alpha.estimate)), _interval(alpha)),
        albedo=(np.asarray(albedo.estimate) / intensity, np.asarray(_interval(albedo)) / intensity),
    )


def _interval(one: Estimate) -> tuple[float, float]:
    assert one.interval_90 is not None
    return one.interval_90


def _left(report: MaterialReport) -> dict[str, float]:
    layers, scene = report.layers, report.scene
    assert layers is not None
    row, column = np.indices(layers.model.shape[:2]).reshape(2, -1)
    seen = surface(scene.camera, scene.sphere, layers.origin_px[0] + column, layers.origin_px[1] + row)
    towards = scene.lights[0].at(seen.normal)[0]
    lit = np.einsum("ni,ni->n", seen.normal, towards) > MIN_N_DOT_L
    inner = (seen.normal[:, 2] > MIN_N_DOT_V) & lit
    flags = np.stack([plane.flags for plane in report.image.planes], axis=-1)
    on_ball, fitted = np.isfinite(layers.model), inner.reshape(*layers.model.shape[:2], 1)
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


def main(every: int = 1) -> None:
    """Print the figures."""
    found = [alone(index) for index in range(0, 48, every)]
    rms, glaring, edge, glare = (
        np.median([getattr(one, name) for one in found]) for name in ("used", "with_glare", "with_edge", "glare")
    )
    roughness = held([one.alpha[0] for one in found], [one.alpha[1] for one in found])
    body = [held([one.albedo[0][c] for one in found], [one.albedo[1][:, c] for one in found]) for c in range(3)]
    sys.stdout.write(
        f"{len(found)} photographs, medians: relative rms {rms:.4f} (asked {ASKED_RMS}), with glare {glaring:.4f}, "
        f"with the ball's edge {edge:.4f}; {100 * glare:.3f} % of samples in glare\n"
        f"90 % intervals that hold the others' median ({ASKED_HELD[0]} to {ASKED_HELD[1]}): alpha {roughness:.3f}, "
        f"albedo {' '.join(f'{share:.3f}' for share in body)}\n"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
