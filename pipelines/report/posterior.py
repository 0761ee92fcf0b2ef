"""STEM.posterior.nc: every draw of every fit, laid out as ArviZ reads it.

The best fit's groups stand at the root: `posterior` (chain, draw[, channel]), `sample_stats` (how well it was
sampled) and `fit` (what one number, or one a block of the surface, says of the model). The same three of every
other fit stand under /fits/NAME. No clock is written: the same fits give the same bytes.
"""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np

import toolkit
from toolkit.records import Fit

from . import netcdf

DIMENSIONS = ("chain", "draw", "channel")
DIAGNOSTICS = ("ess_min", "r_hat_max", "tau_max", "acceptance")


def write_posterior(path: Path, *, fits: tuple[Fit, ...], best: int, sha256: str) -> None:
    """Write a netCDF-4 file that `xarray.open_datatree` and `arviz.from_netcdf` open; `sha256` is the photograph's."""
    path.write_bytes(_image(fits, best, sha256))


def _image(fits: tuple[Fit, ...], best: int, sha256: str) -> bytes:
    with netcdf.new_file() as file, netcdf.group(file, "fits") as others:
        for index, (name, fit) in enumerate(zip(names(fits), fits, strict=True)):
            with nullcontext(file) if index == best else netcdf.group(others, name) as owner:
                _write_fit(owner, fit, sha256)
        return netcdf.image(file)


def names(fits: tuple[Fit, ...]) -> list[str]:
    """A name for each fit, unique: the model, its diffuse lobe where that is not Lambert's, a number where needed."""
    found: list[str] = []
    for fit in fits:
        base = fit.model if fit.diffuse == "lambert" else f"{fit.model}+{fit.diffuse}"
        count = sum(name.split("#")[0] == base for name in found)
        found.append(f"{base}#{count + 1}" if count else base)
    return found


def _write_fit(owner: netcdf.Handle, fit: Fit, sha256: str) -> None:
    with netcdf.group(owner, "posterior") as group:
        netcdf.write_attributes(group, _about(fit) | {"image_sha256": sha256})
        if fit.draws:
            _write_draws(group, fit)
    with netcdf.group(owner, "sample_stats") as group:
        for name in DIAGNOSTICS if fit.diagnostics else ():
            netcdf.write_variable(group, name, float(getattr(fit.diagnostics, name)))
    with netcdf.group(owner, "fit") as group:
        with netcdf.dimensions(group, {"block": np.arange(len(fit.elpd_blocks))}) as scales:
            netcdf.write_variable(group, "elpd_blocks", np.asarray(fit.elpd_blocks, float), [scales["block"]])
        netcdf.write_variable(group, "chi2_reduced", float(fit.chi2_reduced))
        netcdf.write_variable(group, "elpd", float(fit.elpd))


def _write_draws(group: netcdf.Handle, fit: Fit) -> None:
    chains, draws = np.shape(next(iter(fit.draws.values())))[:2]
    units = {parameter.name: parameter.unit for parameter in fit.parameters}
    with netcdf.dimensions(
        group, {"chain": np.arange(chains), "draw": np.arange(draws), "channel": [*"RGB"]}
    ) as scales:
        for name, values in fit.draws.items():
            over = [scales[dimension] for dimension in DIMENSIONS[: np.ndim(values)]]
            netcdf.write_variable(group, name, values, over, unit=units.get(name, "1"))


def _about(fit: Fit) -> dict[str, str | int]:
    return {
        "model": fit.model,
        "variant": ",".join(f"{option}={choice}" for option, choice in sorted(fit.variant.items())),
        "diffuse": fit.diffuse,
        "status": "converged" if fit.status == "converged" else "not converged",
        "inference_library": "emcee",
        "seed": fit.diagnostics.seed if fit.diagnostics else -1,
        "fit_material_version": toolkit.__version__,
    }
