"""Each test plans its own fake fits."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from . import fake


@contextmanager
def planned(folder: Path) -> Iterator[Path]:
    """The folder that the fake fits look at, in this process and in its workers; the fit itself is put back."""
    import pipelines.fit_material
    from pipelines.report import write

    folder.mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(fake.PLAN, str(folder))
        patch.setattr("pipelines.fit_material.fit_jointly", pipelines.fit_material.fit_jointly)
        patch.setattr(write, "_writers", write._writers)
        yield folder


@pytest.fixture
def plan(tmp_path: Path) -> Iterator[Path]:
    """As `planned`, for one test."""
    with planned(tmp_path / "plan") as folder:
        yield folder
