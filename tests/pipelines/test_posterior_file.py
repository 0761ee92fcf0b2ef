"""STEM.posterior.nc: laid out as ArviZ reads it, the same bytes whoever looks on."""

from __future__ import annotations

import random
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import h5netcdf
import numpy as np
import pytest
import xarray

from pipelines.report.posterior import names, write_posterior
from tests.pipelines import fakes
from toolkit.records import MaterialReport

HOLDERS, HELD = 8, 40


@pytest.fixture(scope="module")
def report() -> MaterialReport:
    return fakes.report(width_px=96, height_px=72, draws=20)


def test_the_posterior_reads_back_as_arviz_lays_it_out(report: MaterialReport, tmp_path: Path) -> None:
    """The best fit's groups at the root, the others under /fits; chain and draw first, channels by name."""
    write_posterior(tmp_path / "p.nc", fits=report.fits, best=1, sha256=report.image.sha256)
    with xarray.open_datatree(tmp_path / "p.nc", engine="h5netcdf") as tree:
        root = tree["posterior"]
        assert root.attrs["model"] == "phong"
        assert root["shininess"].dims == ("chain", "draw")
        assert root["diffuse_albedo"].dims == ("chain", "draw", "channel")
        assert list(root["channel"].values) == ["R", "G", "B"]
        np.testing.assert_array_equal(root["shininess"].values, report.fits[1].draws["shininess"])
        assert set(tree["fits"].children) == {"torrance-sparrow", "blinn-phong", "beckmann", "ggx"}
        assert tree["fits/ggx/posterior/alpha"].attrs["units"] == "1"
        assert float(tree["sample_stats/ess_min"]) == pytest.approx(1834.2)
        assert float(tree["fit/elpd_blocks"].sum()) == pytest.approx(report.fits[1].elpd)


def test_fits_of_one_model_get_names_of_their_own(report: MaterialReport) -> None:
    """Another diffuse lobe shows in the name, another variant in a number."""
    fit = report.fits[0]
    assert names((fit, replace(fit, diffuse="wolff"), fit, fit)) == [
        "torrance-sparrow",
        "torrance-sparrow+wolff",
        "torrance-sparrow#2",
        "torrance-sparrow#3",
    ]


def test_a_fit_without_draws_still_has_its_groups(report: MaterialReport, tmp_path: Path) -> None:
    """A fit that failed to sample keeps what is known of it."""
    failed = replace(report.fits[2], draws={}, diagnostics=None, status="stopped", elpd_blocks=np.zeros(0))
    write_posterior(tmp_path / "p.nc", fits=(report.fits[0], failed), best=0, sha256="")
    with h5netcdf.File(tmp_path / "p.nc") as file:
        assert set(file["fits/blinn-phong"].groups) == {"posterior", "sample_stats", "fit"}
        assert file["fits/blinn-phong/posterior"].attrs["status"] == "not converged"


@contextmanager
def frames_held(seed: int) -> Iterator[None]:
    """As a profiler that samples: now and then what a call sees is kept, for a while longer than the call lasts."""
    rng = random.Random(seed)  # noqa: S311  # moments, no secrets
    held: deque[dict[str, Any]] = deque(maxlen=HELD)

    def look(frame: FrameType, event: str, arg: object) -> None:
        if rng.random() < 0.2:
            held.append(dict(frame.f_locals) | {"": arg})

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        yield
    finally:
        sys.setprofile(before)


def contents(write: Callable[[Path], None], path: Path) -> set[bytes]:
    """What `write` leaves when nobody looks on, and under each of the holders."""
    write(path)
    found = {path.read_bytes()}
    for seed in range(HOLDERS):
        with frames_held(seed):
            write(path)
        found.add(path.read_bytes())
    return found


def test_the_bytes_do_not_tell_who_looked_on(report: MaterialReport, tmp_path: Path) -> None:
    """A profiler that holds frames, such as dask's, leaves the layout of the file alone."""
    write = partial(write_posterior, fits=report.fits, best=report.best, sha256=report.image.sha256)
    assert len(contents(write, tmp_path / "p.nc")) == 1


def test_a_control_whose_layout_tells_is_seen(tmp_path: Path) -> None:
    """The check itself: h5netcdf closes its objects with the last reference from Python, and the holders move them."""

    def write(path: Path) -> None:
        with h5netcdf.File(path, "w") as file:
            file.dimensions = {"draw": 40}
            for name in "abcd":
                file.create_variable(name, ("draw",), data=np.arange(40.0), compression="gzip").attrs["units"] = "1"

    assert len(contents(write, tmp_path / "p.nc")) > 1
