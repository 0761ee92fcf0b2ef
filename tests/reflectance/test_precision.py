"""Lobes answer in the precision of the cosines that they are asked with."""

from __future__ import annotations

import numpy as np
import pytest

from tests.laws.space import UP, around, cases, extremes
from toolkit.reflectance import LOBES, Cosines


@pytest.mark.parametrize("name", [name for name, lobe in LOBES.items() if lobe.sharp_angle != "mirror"])
def test_single_precision_is_kept(name: str) -> None:
    """So that a picture takes half the time; finite, and without a warning, at grazing as well."""
    lobe, single = LOBES[name], np.float32
    for pairs in (around(64), extremes()):
        cosines = Cosines.of(UP.astype(single), *(vectors.astype(single) for vectors in pairs))
        for variant, shape in cases(lobe):
            value = lobe.value(cosines, [single(number) for number in shape], variant)
            assert value.dtype == single, variant
            assert np.isfinite(value).all(), (variant, shape)
