"""One trial from its numbers to a line of the record: rendered, photographed, fitted as a user would, compared."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from synthetic.lights import movable
from synthetic.render import Render
from synthetic.scenes import exposed
from toolkit.errors import FitMaterialError
from toolkit.inference.fisher import bound_sds
from toolkit.inference.infer import gather_for
from toolkit.inference.model import Model
from toolkit.inference.nuisances import shifts_of
from toolkit.inference.problem import pose
from toolkit.records import Estimate, Fit, Floats, MaterialReport

from .broken import as_asked
from .design import Trial
from .score import missed
from .shot import Shot, shoot, write

Line = dict[str, Any]
INNER = 0.95  # of the radius: the limb's pixels are half background


def run_trial(trial: Trial, folder: Path, *, discrepancy: bool = True) -> Line:
    """The trial's line; a failure is a line too. The photograph of what failed or missed is kept in `folder`."""
    begin = time.perf_counter()
    shot = as_asked(shoot(trial), trial.broken, trial.amount)
    path, truth = write(shot, folder, trial.name)
    rendered = time.perf_counter() - begin
    line: Line = {"number": trial.number, "model": trial.model, "diffuse": trial.diffuse, "broken": trial.broken}
    line |= {"amount": trial.amount, "scene": dict(trial.scene)}
    try:
        report = _fitted(path, trial, discrepancy=discrepancy)
    except FitMaterialError as error:
        return line | {"status": "failed", "reason": str(error), "file": path.name}
    except Exception as error:  # a defect must show in the table, not end the run
        return line | {"status": "failed", "reason": f"{type(error).__name__}: {error}", "file": path.name}
    fit = report.fits[report.best]
    line |= {
        "status": "done",
        "flags": sorted({*report.flags, *fit.flags}),
        "numbers": list(_compared(fit, truth, {} if trial.broken else _bounds(report, shot, trial, truth))),
        "psnr_db": _psnr_db(report, shot),
        "chi2_reduced": fit.chi2_reduced,
        "seconds": {"render": rendered, **report.seconds},
    }
    if not trial.broken and missed(line):
        return line | {"file": path.name}
    path.unlink()
    Path(f"{path}.toml").unlink()
    return line


def _fitted(path: Path, trial: Trial, *, discrepancy: bool) -> MaterialReport:
    from pipelines.fit_material import fit_material
    from pipelines.layers import Layer, resolve

    asked = {
        "models": [trial.model],
        "diffuse": [trial.diffuse],
        "seed": trial.seed % 2**32,
        "discrepancy": "on" if discrepancy else "off",
    }
    return fit_material(path, resolve(path, flags=[Layer(name="the trial", values={"fit": asked})]))


def _bounds(report: MaterialReport, shot: Shot, trial: Trial, truth: Mapping[str, Any]) -> dict[str, Floats]:
    """The Cramer-Rao bound of each number of the truth, in the true scene with the calibration's stated errors."""
    scene = exposed(shot.scene, shot.exposure)
    if shot.scene.scale == "relative":
        unsaid = tuple(movable(light).model_copy(update={"irradiance": None}) for light in scene.lights)
        scene = replace(scene, lights=unsaid, scale="relative")
    model = Model.named(trial.model, trial.diffuse)
    problem = pose(model, scene, gather_for(report.image, scene), report.image.noise)
    if problem.fresnel.kind == "pair":  # its numbers are ratios of the linear ones: no bound in closed form
        return {}
    return bound_sds(problem, {name: np.atleast_1d(value) for name, value in truth.items()}, shifts_of(scene))


def _compared(fit: Fit, truth: Mapping[str, Any], bounds: Mapping[str, Floats]) -> Iterator[Line]:
    """Each number of the truth beside its posterior."""
    estimates = {e.name: e for e in fit.parameters if e.estimate is not None}
    for name, true in truth.items():
        if name in estimates and not (name == "specular_strength" and "specular_f0" in truth):
            yield from _numbers(name, np.atleast_1d(true), estimates[name], fit.draws[name], bounds.get(name))


def _numbers(name: str, truth: Floats, estimate: Estimate, draws: Floats, bound: Floats | None) -> Iterator[Line]:
    mean, sd = np.atleast_1d(estimate.estimate), np.atleast_1d(estimate.sd)  # type: ignore[arg-type]  # not None here
    flat = draws.reshape(-1, len(truth))
    low, high = np.percentile(flat, [2.5, 97.5], axis=0)
    to_prior = np.atleast_1d(estimate.posterior_to_prior)  # type: ignore[arg-type]  # there where an estimate is
    for c, true in enumerate(truth):
        yield {
            "name": name,
            "channel": c if len(truth) > 1 else None,
            "truth": float(true),
            "mean": float(mean[c]),
            "sd": float(sd[c]),
            "rank": float((np.count_nonzero(flat[:, c] < true) + 0.5) / (len(flat) + 1.0)),
            "bound_sd": None if bound is None else float(bound[c]),
            "bound_to_prior": None if bound is None else float(bound[c] * to_prior[c] / max(sd[c], 1e-300)),
            "interval_95": [float(low[c]), float(high[c])],
        }


def _psnr_db(report: MaterialReport, shot: Shot) -> float | None:
    """Peak signal to noise of the diffuse layer against the render's, inside the ball; None where it has no layers."""
    layers = report.layers
    if layers is None:
        return None
    (x0, y0), step = layers.origin_px, layers.step_px
    height, width = layers.diffuse.shape[:2]
    true = _diffuse_at(shot.picture, x0 + step * np.arange(width), y0 + step * np.arange(height)) * shot.exposure
    (cx, cy), radius = shot.scene.sphere.centre_px, shot.scene.sphere.radius_px
    x, y = np.meshgrid(x0 + step * np.arange(width) - cx, y0 + step * np.arange(height) - cy)
    inside = np.hypot(x, y) < INNER * radius
    error = (layers.diffuse - true)[inside]
    return float(10.0 * np.log10(true.max() ** 2 / max(float(np.nanmean(error**2)), 1e-30)))


def _diffuse_at(picture: Render, x_px: Floats, y_px: Floats) -> Floats:
    """The render's diffuse layer (len(y), len(x), 3) at places between pixels, bilinear: a quad's middle."""
    from scipy.ndimage import map_coordinates

    (x0, y0) = picture.origin_px
    places = np.meshgrid(y_px - y0, x_px - x0, indexing="ij")
    return np.stack([map_coordinates(picture.diffuse[..., c], places, order=1, mode="nearest") for c in range(3)], -1)
