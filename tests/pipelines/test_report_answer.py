"""The head of the page: what it says of how sure the best model is."""

from __future__ import annotations

import re
from dataclasses import replace

from pipelines.export.material import material_of
from pipelines.report.answer import answer
from pipelines.report.rows import title
from tests.pipelines import fakes
from toolkit.records import Fit


def test_the_best_is_told_ahead_of_what_stands_against_it() -> None:
    """Not of itself over another body that adds nothing to it; nor is it ahead of what predicts a trifle better."""
    good = fakes.report()
    best, other = good.fits[0], good.fits[3]
    extended = replace(best, diffuse="oren-nayar", shape={**best.shape, "diffuse_roughness_rad": 0.0})
    blocks = best.elpd_blocks + 1e-4
    rival = replace(other, elpd=float(blocks.sum()), elpd_blocks=blocks)

    def told(*others: Fit) -> str:
        report = replace(good, fits=(best, *others))
        return answer(report, material_of(report)).certainty

    assert told(extended, other) == told(other)
    assert re.fullmatch(r"ahead of .+ by [\d.]+ ± [\d.]+ in log predictive density", told(other))
    assert told(rival) == f"preferred to {title(rival.model)}"
