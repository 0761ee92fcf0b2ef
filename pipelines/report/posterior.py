"""STEM.posterior.nc: every draw of every fit, laid out as ArviZ reads it.

The best fit's groups stand at the root: `posterior` (chain, draw[, channel]), `sample_stats` (how well it was
sampled) and `fit` (what one number, or one a block of the surface, says of the model). The same three of every
other fit stand under /fits/NAME. No clock is written: the same fits give the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import toolkit
from toolkit.records import Fit, MaterialReport

if TYPE_CHECKING:
    import h5netcdf

DIMENSIONS = ("chain", "draw", "channel")
PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}  # draws are nearly noise: more gains nothing
DIAGNOSTICS = ("ess_min", "r_hat_max", "tau_max", "acceptance")


def write_posterior(path: Path, report: MaterialReport) -> None:
    """Write a netCDF-4 file that `xarray.open_datatree` and `arviz.from_netcdf` open; packed without loss.

    It is laid out in memory first: on a full disk HDF5 leaves its file open and its complaints on the terminal.
    """
    import io

    import h5netcdf

    held = io.BytesIO()
    with h5netcdf.File(held, "w") as file:
        for index, (name, fit) in enumerate(zip(names(report.fits), report.fits, strict=True)):
            group = file if index == report.best else file.create_group(f"fits/{name}")
            _write_draws(group.create_group("posterior"), fit, report.image.sha256)
            _write_scalars(group.create_group("sample_stats"), _diagnostics(fit))
            _write_quality(group.create_group("fit"), fit)
    path.write_bytes(held.getvalue())  # a copy: a view would outlive a failed write and block the buffer's end


def names(fits: tuple[Fit, ...]) -> list[str]:
    """A name for each fit, unique: the model, its diffuse lobe where that is not Lambert's, a number where needed."""
    found: list[str] = []
    for fit in fits:
        base = fit.model if fit.diffuse == "lambert" else f"{fit.model}+{fit.diffuse}"
        count = sum(name.split("#")[0] == base for name in found)
        found.append(f"{base}#{count + 1}" if count else base)
    return found


def _write_draws(group: h5netcdf.Group, fit: Fit, sha256: str) -> None:
    group.attrs.update(_about(fit) | {"image_sha256": sha256})
    if not fit.draws:
        return
    chains, draws = np.shape(next(iter(fit.draws.values())))[:2]
    group.dimensions = {"chain": chains, "draw": draws, "channel": 3}
    for name, values in (
        ("chain", np.arange(chains)),
        ("draw", np.arange(draws)),
        ("channel", np.array([*"RGB"], "O")),
    ):
        group.create_variable(name, (name,), data=values, dtype=_text() if name == "channel" else None)
    units = {parameter.name: parameter.unit for parameter in fit.parameters}
    for name, values in fit.draws.items():
        variable = group.create_variable(name, DIMENSIONS[: np.ndim(values)], data=np.asarray(values), **PACKED)
        variable.attrs["units"] = units.get(name, "1")


def _text() -> np.dtype[np.object_]:
    import h5py

    return h5py.string_dtype()  # type: ignore[no-any-return]  # h5py ships no types


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


def _write_scalars(group: h5netcdf.Group, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        group.create_variable(name, (), data=np.float64(value))


def _diagnostics(fit: Fit) -> dict[str, float]:
    return {name: getattr(fit.diagnostics, name) for name in DIAGNOSTICS} if fit.diagnostics else {}


def _write_quality(group: h5netcdf.Group, fit: Fit) -> None:
    group.dimensions = {"block": len(fit.elpd_blocks)}
    group.create_variable("elpd_blocks", ("block",), data=np.asarray(fit.elpd_blocks, float))
    _write_scalars(group, {"chi2_reduced": fit.chi2_reduced, "elpd": fit.elpd})
