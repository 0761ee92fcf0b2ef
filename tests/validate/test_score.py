"""The verdict is bad exactly where the numbers are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm

from pipelines.validate.outcome import outcome, table, worse
from pipelines.validate.page import page_text
from pipelines.validate.score import covered, score, uniform_p


def lines(
    count: int = 300, *, wide: float = 1.0, shift: float = 0.0, noisy: float = 1.0, seed: int = 0
) -> list[dict[str, Any]]:
    """A record as trials would leave it: stated sds `wide` x the true ones, means off by `shift`, scatter `noisy`."""
    rng, found = np.random.default_rng(seed), []
    for i in range(count):
        numbers = []
        for channel in range(3):
            error = noisy * rng.standard_normal() + shift
            numbers.append(
                {
                    "name": "diffuse_albedo",
                    "channel": channel,
                    "truth": 1.0,
                    "mean": 1.0 + 0.01 * error,
                    "sd": 0.01 * wide,
                    "rank": float(norm.cdf(-error / wide)),
                    "bound_sd": 0.01,
                    "interval_95": [0.0, 1.0],
                }
            )
        found.append(
            {
                "number": i,
                "model": "ggx",
                "diffuse": "lambert",
                "broken": "",
                "amount": 0.0,
                "scene": {},
                "status": "done",
                "flags": [],
                "numbers": numbers,
                "psnr_db": 50.0,
                "chi2_reduced": 1.0,
                "seconds": {"fit": 0.5},
            }
        )
    return found


def failed(line: dict[str, Any], reason: str) -> dict[str, Any]:
    """The line of a trial whose fit raised."""
    kept = {key: line[key] for key in ("number", "model", "diffuse", "broken", "amount", "scene")}
    return kept | {"status": "failed", "reason": reason, "file": "trial-00000.dng"}


def test_right_posteriors_are_trusted() -> None:
    """Coverage, scatter and ranks in order: nothing to complain about."""
    found = score(lines())
    assert not found.complaints
    assert found.verdict.startswith("To be trusted")
    assert found.coverage[0.9] == pytest.approx(0.9, abs=0.025)
    assert found.efficiency == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"wide": 0.6}, "held the truth"),
        ({"wide": 1.8}, "held the truth"),
        ({"shift": 0.7}, "uneven"),
        ({"noisy": 1.3, "wide": 1.3}, "least possible"),
    ],
    ids=["too narrow", "too wide", "off", "wasteful"],
)
def test_wrong_posteriors_are_not(wrong: dict[str, float], complaint: str) -> None:
    """Intervals too narrow or too wide, answers off, or scatter beyond the bound: each is named."""
    found = score(lines(**wrong))  # type: ignore[arg-type]  # floats all
    assert any(complaint in said for said in found.complaints)
    assert found.verdict.startswith("Not to be trusted yet")


def test_failures_false_alarms_and_silence_are_named() -> None:
    """A failed fit, alarms on clean renders, and a broken assumption that misleads without one."""
    record = lines()
    record[0] = failed(record[0], "no light")
    for line in record[1:20]:
        line["flags"] = ["poor_fit"]
    stressed = [
        {**line, "number": 1000 + i, "broken": "stray", "amount": 5.0} for i, line in enumerate(lines(8, shift=9))
    ]
    said = " ".join(score(record + stressed).complaints)
    assert "1 fits failed" in said
    assert "raised an alarm" in said
    assert "stray 5" in said
    for line in stressed:
        line["flags"] = ["structured_residuals"]
    assert "stray 5" not in " ".join(score(record + stressed).complaints)


def test_the_chance_of_even_ranks_is_even() -> None:
    """Over many sets of even ranks the test's own chances are spread evenly, and it sees what is not even."""
    rng = np.random.default_rng(1)
    chances = [uniform_p(rng.random(150)) for _ in range(200)]
    assert kstest(chances, "uniform").pvalue > 0.01
    assert uniform_p(norm.cdf(rng.standard_normal(150) / 0.7)) < 1e-3
    assert uniform_p(norm.cdf(rng.standard_normal(150) + 0.5)) < 1e-3
    assert covered(np.array([0.04, 0.06, 0.5, 0.96])) == {0.5: 0.25, 0.68: 0.25, 0.9: 0.5, 0.95: 1.0}


def test_only_a_real_change_for_the_worse_counts() -> None:
    """The same set with other noise is no change; narrower intervals, wasted light or lost decibels are."""
    before = outcome(score(lines()), seconds=1.0, trials="quick")
    assert worse(outcome(score(lines(seed=1)), seconds=9.0, trials="quick"), before) == []
    for wrong, said in (({"wide": 0.6}, "coverage"), ({"noisy": 1.4, "wide": 1.4}, "bound")):
        changed = worse(outcome(score(lines(**wrong)), seconds=1.0, trials="quick"), before)  # type: ignore[arg-type]
        assert any(said in text for text in changed)
    dim = [{**line, "psnr_db": 40.0} for line in lines()]
    assert any("PSNR" in text for text in worse(outcome(score(dim), seconds=1.0, trials="quick"), before))


def test_page_and_table_hold_hostile_words_harmless() -> None:
    """A reason that holds HTML is shown, not run; the table has a row a number."""
    record = lines(30)
    reason = "<script>alert(1)</script>"
    record[0] = failed(record[0], reason)
    page = page_text(score(record), record, title="<b>mine</b>", told="told")
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert table(record).count("\n") == 1 + 1 + 29 * 3
