"""Where the real photographs and measured materials are that some tests need."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


def folder(name: str) -> Path:
    """The folder `name` of the real data; skips the calling test where it is not there."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    found = Path(os.environ.get("FIT_MATERIAL_DATA", beside)) / name
    if not found.is_dir():
        pytest.skip(f"needs the real data {name!r}: set FIT_MATERIAL_DATA to the folder that holds it")
    return found
