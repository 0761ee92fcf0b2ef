"""Measured materials, which no lobe is: every answer is flagged, and the model's error is of the size that is told.

The table of docs/validation.md is `python -m tests.validation.measured`.
"""

from __future__ import annotations

import pytest

from .measured import LIGHTS, MATERIALS, landing, measured

QUICK = {"models": ["torrance-sparrow", "ggx"], "diffuse": ["lambert"], "ess": 500}
ERROR = {"cc_iris_purple_gem": 0.25, "paper_white": 0.12, "satin_rosaline": 0.20, "vch_golden_yellow": 0.40}


@pytest.mark.slow
@pytest.mark.parametrize("light", LIGHTS, ids=lambda light: f"{light[0]:g} degrees")
@pytest.mark.parametrize("name", MATERIALS)
def test_a_material_that_no_lobe_fits_is_never_passed_off_as_known(name: str, light: tuple[float, float]) -> None:
    """More than 1 % of the picture is missed, an alarm says so, and the error stays of the table's size."""
    found = landing(measured(name), light, QUICK)
    assert found.here > 0.01
    assert found.alarms
    assert found.here < ERROR[name]


@pytest.mark.slow
def test_a_material_that_is_a_lobe_raises_no_alarm() -> None:
    """The control: Mitsuba's own Beckmann over Lambert, photographed and fitted the same way, is foreseen to 0.2 %."""
    found = landing(None, LIGHTS[1], {"models": ["beckmann:masking=smith"], "diffuse": ["lambert"]})
    assert not found.alarms
    assert found.here < 0.002
    assert found.elsewhere < 0.002
