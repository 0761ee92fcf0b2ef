"""Every law over every registered lobe, every variant and every corner of its box."""

from __future__ import annotations

import pytest

from toolkit.reflectance import LOBES

from .laws import LAWS


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", LOBES)
def test_law(name, law):
    """A registered lobe keeps every law that applies to it."""
    LAWS[law](LOBES[name])
