"""Each test plans its own fake fits."""

from __future__ import annotations

from pathlib import Path

import pytest

from . import fake


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that the fake fits look at, in this process and in its workers; the fit itself is put back."""
    import pipelines.fit_material
    from pipelines.report import write

    folder = tmp_path / "plan"
    folder.mkdir()
    monkeypatch.setenv(fake.PLAN, str(folder))
    monkeypatch.setattr("pipelines.fit_material.fit_material", pipelines.fit_material.fit_material)
    monkeypatch.setattr(write, "_writers", write._writers)
    return folder
