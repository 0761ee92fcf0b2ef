"""One model on one photograph, from cells to a `Fit`: optimum, posterior, estimates, predictive density."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from toolkit.records import Fit, Floats, LinearImage, Scene

from .cells import Cells, gather
from .compare import blocks_of, elpd_blocks
from .estimates import estimates_of, flags_of, named_draws
from .fit import Optimum, pose
from .model import Model
from .normal import inverse
from .nuisances import Shifts, fit_with_shifts, shifted, shifts_of
from .posterior import CHAINS, Draws, Progress, sample


def infer(
    image: LinearImage,
    scene: Scene,
    cells: Cells,
    model: Model,
    *,
    seed: int,
    fixed: Collection[str] = (),
    effective: int = 4000,
    progress: Progress | None = None,
) -> Fit:
    """Fit one model; `fixed` names the calibration that is exactly known ("light", "centre", ..., or "all")."""
    shifts = shifts_of(scene, fixed)
    problem = pose(model, scene, cells, image.noise)
    optimum, total = fit_with_shifts(problem, shifts)
    draws = sample(optimum, seed=seed, effective=effective, progress=progress)
    chi2_reduced, residual = misfit(optimum)
    estimates = estimates_of(optimum, draws)
    blocks = elpd_blocks(optimum, blocks_of(scene, cells))
    at_mode = {name: values[0] for name, values in named_draws(optimum, optimum.u[None], optimum.x[None]).items()}
    names = {p.name for p in model.parameters}
    colours = {name: value for name, value in at_mode.items() if name not in names}
    if optimum.problem.fresnel.kind == "strength":
        colours["specular_f0"] = np.full(3, np.nan)
    return Fit(
        model=model.specular.name,
        variant=dict(model.variant),
        diffuse=model.diffuse.name,
        status=optimum.status,
        flags=flags_of(optimum, estimates, draws, (chi2_reduced, residual)),
        shape={name: float(at_mode[name]) for name in names},
        colours=colours,
        chi2_reduced=chi2_reduced,
        elpd=float(blocks.sum()),
        elpd_blocks=blocks,
        parameters=estimates,
        diagnostics=draws.diagnostics,
        draws=_by_chain(named_draws(optimum, draws.u, draws.x)),
        scene=shifted(scene, shifts, total) if shifts.names else scene,
        nuisances=_shift_table(optimum, shifts, total, draws),
    )


def gather_for(image: LinearImage, scene: Scene) -> Cells:
    """Cells fine enough for every highlight that a photograph's pixels can resolve."""
    pixel_rad = min(p.step_px for p in image.planes) / scene.sphere.radius_px
    return gather(image, scene, finest_rad=float(np.clip(4 * pixel_rad, 0.005, 0.02)))


def misfit(optimum: Optimum) -> tuple[float, float]:
    """Chi-square of the cells' means by the measurement noise alone over its degrees of freedom; relative rms."""
    problem = optimum.problem
    predicted = problem.predict(problem.columns(optimum.u), optimum.x)
    chi2, square, signal, cells = 0.0, 0.0, 0.0, 0
    for w, data, p in zip(optimum.weights, problem.cells.channels, predicted, strict=True):
        residual = data.value - p
        chi2 += float(w @ residual**2)
        square += float(data.count @ residual**2)
        signal += float(data.count @ p**2)
        cells += len(p)
    return chi2 / max(cells - len(optimum.joint), 1), (square / max(signal, 1e-300)) ** 0.5


def _by_chain(draws: Mapping[str, Floats]) -> dict[str, Floats]:
    """Draws in their chains: (CHAINS, draws) or (CHAINS, draws, 3)."""
    return {
        name: values[: len(values) - len(values) % CHAINS].reshape(CHAINS, -1, *values.shape[1:])
        for name, values in draws.items()
    }


def _shift_table(optimum: Optimum, shifts: Shifts, total: Floats, draws: Draws) -> dict[str, tuple[float, float]]:
    layout = optimum.problem.layout
    sd = np.sqrt(np.diag(inverse(optimum.joint)))[len(layout.names) : layout.size]
    return {name: (float(t), float(s)) for name, t, s in zip(shifts.names, total, sd, strict=True)}
