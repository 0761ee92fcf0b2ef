"""One model on one photograph or on several of one material: optimum, posterior, estimates, predictive density."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from toolkit.flags import Flag
from toolkit.records import Fit, Floats, LinearImage, Scene

from .blocks import blocks_of, centred
from .cells import Cells
from .compare import bic_of, elpd_blocks
from .discrepancy import stretch_of, stretched
from .estimates import estimates_of, flags_of, named_draws, posterior_draws, schlick_misleads, statistical_sds
from .gather import gather
from .joint import on_one_scale
from .model import Model
from .nuisances import Shifts, doubted, scale_told, shifted, shifts_of_all
from .posterior import CHAINS, Progress, sample
from .problem import Optimum, pose_views
from .settle import fit_with_shifts
from .solving import inverse
from .structure import LEAST_P, structure_p
from .tempering import by_noise_alone
from .views import View


def infer(
    image: LinearImage,
    scene: Scene,
    cells: Cells,
    model: Model,
    *,
    seed: int,
    fixed: Collection[str] = (),
    discrepancy: bool = True,
    effective: int = 4000,
    progress: Progress | None = None,
) -> Fit:
    """Fit one model to one photograph; as `infer_views` does."""
    return infer_views(
        [View.of(scene, cells, image.noise)],
        model,
        seed=seed,
        fixed=fixed,
        discrepancy=discrepancy,
        effective=effective,
        progress=progress,
    )


def infer_views(
    views: Sequence[View],
    model: Model,
    *,
    seed: int,
    fixed: Collection[str] = (),
    discrepancy: bool = True,
    effective: int = 4000,
    progress: Progress | None = None,
) -> Fit:
    """Fit one model to one photograph, or to several of one material: one shape, the same colours, own calibrations.

    `fixed` names the calibration that is exactly known ("light", "centre", ..., or "all"); without `discrepancy` the
    intervals are those of a model that is exactly right.
    """
    views = on_one_scale(model, views)
    scenes = [view.scene for view in views]
    shifts = shifts_of_all(scenes, fixed)
    where = [blocks_of(view.scene, view.cells) for view in views]
    optimum, total = fit_with_shifts(pose_views(model, views), shifts, where if discrepancy else ())
    by_noise, blocks = by_noise_alone(optimum, *where)
    scores = centred(blocks.score) / optimum.problem.tempering
    stretch = stretch_of(optimum, scores) if discrepancy else np.eye(len(optimum.joint))
    draws = stretched(optimum, sample(optimum, seed=seed, effective=effective, progress=progress), stretch)
    chi2_reduced, residual = misfit(by_noise)
    drawn = posterior_draws(optimum, draws, [s.irradiance_covariance for s in scenes if scale_told(s)])
    estimates = estimates_of(optimum, drawn, statistical_sds(by_noise))
    elpd = elpd_blocks(by_noise, blocks)
    at_mode = {name: values[0] for name, values in named_draws(optimum, optimum.u[None], optimum.x[None]).items()}
    seen = [shifted(scene, shifts, total, v) for v, scene in enumerate(scenes)]
    names = {p.name for p in model.parameters}
    colours = {name: value for name, value in at_mode.items() if name not in names}
    if optimum.problem.fresnel.kind == "strength":
        colours["specular_f0"] = np.full(3, np.nan)
    return Fit(
        model=model.specular.name,
        variant=dict(model.variant),
        diffuse=model.diffuse.name,
        status=optimum.status,
        flags=flags_of(optimum, estimates, draws, (chi2_reduced, residual))
        + ((Flag.CALIBRATION_DOUBTED,) if doubted(optimum, shifts, total) else ())
        + ((Flag.STRUCTURED_RESIDUALS,) if structure_p(by_noise) < LEAST_P else ())
        + ((Flag.SCHLICK_MISLEADS,) if schlick_misleads(optimum, estimates) else ()),
        shape={name: float(at_mode[name]) for name in names},
        colours=colours,
        chi2_reduced=chi2_reduced,
        elpd=float(elpd.sum()),
        elpd_blocks=elpd,
        bic=bic_of(by_noise, blocks),
        tempering=optimum.problem.tempering,
        parameters=estimates,
        diagnostics=draws.diagnostics,
        draws=_by_chain(drawn),
        scene=seen[0],
        others=tuple(seen[1:]),
        nuisances=_shift_table(optimum, shifts, total, stretch),
    )


def gather_for(image: LinearImage, scene: Scene) -> Cells:
    """Cells fine enough for every highlight that a photograph's pixels can resolve."""
    pixel_rad = min(p.step_px for p in image.planes) / scene.sphere.radius_px
    return gather(image, scene, finest_rad=float(np.clip(4 * pixel_rad, 0.005, 0.02)))


def misfit(optimum: Optimum) -> tuple[float, float]:
    """Chi-square of the cells' means by the measurement noise alone over its degrees of freedom; relative rms."""
    chi2, square, signal = 0.0, 0.0, 0.0
    for w, data, p in zip(optimum.weights.weights, optimum.problem.channels, optimum.predicted, strict=True):
        residual = data.value - p
        chi2 += float(w.times(residual) @ residual)
        square += float((data.count * (w.each > 0)) @ residual**2)
        signal += float((data.count * (w.each > 0)) @ p**2)
    return chi2 / max(optimum.weights.counted - len(optimum.joint), 1), (square / max(signal, 1e-300)) ** 0.5


def _by_chain(draws: Mapping[str, Floats]) -> dict[str, Floats]:
    """Draws in their chains: (CHAINS, draws) or (CHAINS, draws, 3)."""
    return {
        name: values[: len(values) - len(values) % CHAINS].reshape(CHAINS, -1, *values.shape[1:])
        for name, values in draws.items()
    }


def _shift_table(optimum: Optimum, shifts: Shifts, total: Floats, stretch: Floats) -> dict[str, tuple[float, float]]:
    named = len(optimum.problem.layout.names)
    covariance = stretch @ inverse(optimum.joint) @ stretch.T
    sd = np.sqrt(np.diag(covariance))[named : named + len(shifts.names)]
    return {name: (float(t), float(s)) for name, t, s in zip(shifts.names, total, sd, strict=True)}
