"""The photograph that ships with the project."""

from __future__ import annotations

from pathlib import Path

import pytest

DEMO = Path(__file__).resolve().parents[2] / "docs" / "demo"


@pytest.fixture(scope="module")
def anew(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from pipelines.cli import main

    out = tmp_path_factory.mktemp("demo") / "demo.dng"
    assert main(["render", str(DEMO / "scene.toml"), "--out", str(out)]) == 0
    return out


@pytest.mark.parametrize("name", ["demo.dng", "demo.dng.toml"])
def test_the_demo_is_made_anew_with_the_same_bytes(anew: Path, name: str) -> None:
    """Its scene file holds all that it takes."""
    assert (anew.parent / name).read_bytes() == (DEMO / name).read_bytes()


def test_the_demo_is_small_and_unclipped() -> None:
    """At most 2 MB; the highlight stays below the white level."""
    import rawpy

    assert (DEMO / "demo.dng").stat().st_size <= 2_000_000
    with rawpy.imread(str(DEMO / "demo.dng")) as raw:
        assert 0.7 * raw.white_level < raw.raw_image_visible.max() < raw.white_level
