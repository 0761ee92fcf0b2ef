"""What is shipped: the three packages with their data, and nothing else."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path

from .console import ROOT

PACKAGES = {"toolkit", "synthetic", "pipelines"}


def test_the_wheel_ships_exactly_the_three_packages(tmp_path: Path) -> None:
    """Each typed, presets with them; no tests, no docs, no photographs; the entry point leads to the command line."""
    from hatchling.builders.wheel import WheelBuilder

    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (points,) = (archive.read(name).decode() for name in names if name.endswith("entry_points.txt"))
    tops = {name.partition("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == PACKAGES
    assert {f"{package}/py.typed" for package in PACKAGES} <= names
    assert {f"pipelines/presets/{name}.toml" for name in ("quick", "standard", "careful")} <= names
    assert "fit-material = pipelines.cli:main" in points
    sources = {str(path.relative_to(ROOT)) for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
    assert sources <= names


def test_the_locked_requirements_name_no_registry() -> None:
    """Any index may serve them; hashes say that they are the right files."""
    for name in ("run.txt", "dev.txt"):
        text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
        assert "://" not in text
        assert "--hash=sha256:" in text
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["requires-python"] == ">=3.11"
