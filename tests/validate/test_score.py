"""The verdict is bad exactly where the numbers are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest, norm

from pipelines.report.result import result_text
from pipelines.validate.outcome import outcome, read_record, table, worse
from pipelines.validate.page import page_text
from pipelines.validate.ranks import BAND, band, covered, uniform_p
from pipelines.validate.score import score
from pipelines.validate.verdict import complaints, verdict
from toolkit.errors import BadInputError

ROOT = Path(__file__).parents[2]


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
                    "bound_to_prior": 0.01,
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
                "file": f"trial-{i:05d}.dng",
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
    assert not complaints(found)
    assert verdict(found).startswith("To be trusted")
    assert found.all.coverage[0.9] == pytest.approx(0.9, abs=0.025)
    assert found.all.efficiency == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"wide": 0.6}, "held the truth"),
        ({"wide": 1.8}, "held the truth"),
        ({"shift": 0.7}, "uneven"),
        ({"noisy": 1.4, "wide": 1.4}, "least possible"),
    ],
    ids=["too narrow", "too wide", "off", "wasteful"],
)
def test_wrong_posteriors_are_not(wrong: dict[str, float], complaint: str) -> None:
    """Intervals too narrow or too wide, answers off, or scatter beyond the bound: each is named."""
    found = score(lines(**wrong))  # type: ignore[arg-type]  # floats all
    assert any(complaint in said for said in complaints(found))
    assert verdict(found).startswith("Not to be trusted yet")


def test_failures_false_alarms_and_silence_are_named() -> None:
    """A failed fit, alarms on clean renders, and a broken assumption that misleads without one."""
    record = lines()
    record[0] = failed(record[0], "no light")
    for line in record[1:20]:
        line["flags"] = ["poor_fit"]
    stressed = [
        {**line, "number": 1000 + i, "broken": "stray", "amount": 5.0} for i, line in enumerate(lines(8, shift=9))
    ]
    said = " ".join(complaints(score(record + stressed)))
    assert "1 fit failed" in said
    assert "raised an alarm" in said
    assert "stray light (5 % of the body)" in said
    for line in stressed:
        line["flags"] = ["structured_residuals"]
    assert "stray light" not in " ".join(complaints(score(record + stressed)))


def test_the_chance_of_even_ranks_is_even() -> None:
    """Over many sets of even ranks the test's own chances are spread evenly, and it sees what is not even."""
    rng = np.random.default_rng(1)
    chances = [uniform_p(rng.random(150)) for _ in range(200)]
    assert kstest(chances, "uniform").pvalue > 0.01
    assert uniform_p(norm.cdf(rng.standard_normal(150) / 0.7)) < 1e-3
    assert uniform_p(norm.cdf(rng.standard_normal(150) + 0.5)) < 1e-3
    assert 0.0 < uniform_p(norm.cdf(rng.standard_normal(150) + 0.4)) < 1e-4  # no simulation's end
    assert covered(np.array([0.04, 0.06, 0.5, 0.96])) == {0.5: 0.25, 0.68: 0.25, 0.9: 0.5, 0.95: 1.0}


def test_the_band_holds_even_ranks_all_along() -> None:
    """As often as it says, judged over a thousand sets; ranks of intervals too narrow leave it."""
    at, low, high = band(150)
    rng = np.random.default_rng(2)

    def inside(ranks: np.ndarray[Any, Any]) -> bool:
        share = np.searchsorted(np.sort(ranks), at, side="right") / len(ranks)
        return bool(np.all((share >= low) & (share <= high)))

    assert np.mean([inside(rng.random(150)) for _ in range(1000)]) == pytest.approx(BAND, abs=0.01)
    assert not inside(norm.cdf(rng.standard_normal(150) / 0.7))


def test_a_handful_that_all_hold_is_no_complaint() -> None:
    """Eight renders whose every interval holds the truth say nothing against intervals of 90 %; eighty do."""
    calm = [{**line, "numbers": [{**n, "rank": 0.4} for n in line["numbers"]]} for line in lines(80)]
    assert not any("held the truth" in said for said in complaints(score(calm[:8])))
    assert any("held the truth" in said for said in complaints(score(calm)))


def test_one_bad_model_or_parameter_among_many_is_named() -> None:
    """Seven models of which one states its sds at half: the pooled coverage passes, the model's own does not."""
    record = [
        {**line, "model": f"model-{m}", "number": 1000 * m + line["number"]}
        for m in range(7)
        for line in lines(150, seed=m, wide=0.65 if m == 3 else 1.0)
    ]
    found = score(record)
    assert 0.87 < found.all.coverage[0.9] < 0.93
    (said,) = [said for said in complaints(found) if "held the truth" in said]
    assert "model-3" in said
    before = outcome(score([{**line, "model": "model-3"} for line in lines(150)]), seconds=1.0, trials="quick")
    assert any("model-3" in change for change in worse(outcome(found, seconds=1.0, trials="quick"), before))


def test_what_a_photograph_hardly_tells_does_not_count_against_the_bound() -> None:
    """A shape number whose bound comes near its prior's width takes its render out of the ratio; ranks keep it."""
    record = lines(60)
    for line in record[:30]:
        line["numbers"] = [{**n, "mean": 1.1, "name": "alpha", "channel": None} for n in line["numbers"][:1]]
        line["numbers"][0]["bound_to_prior"] = 0.3
    found = score(record)
    assert found.all.count == 60
    assert found.all.efficiency < 1.2
    for line in record[:30]:
        line["numbers"][0]["bound_to_prior"] = 0.01
    assert score(record).all.efficiency > 3.0


def test_only_a_real_change_for_the_worse_counts() -> None:
    """The same set with other noise is no change; narrower intervals, wasted light or lost decibels are."""
    before = outcome(score(lines()), seconds=1.0, trials="quick")
    assert worse(outcome(score(lines(seed=1)), seconds=9.0, trials="quick"), before) == []
    for wrong, said in (({"wide": 0.6}, "coverage"), ({"noisy": 1.4, "wide": 1.4}, "bound")):
        changed = worse(outcome(score(lines(**wrong)), seconds=1.0, trials="quick"), before)  # type: ignore[arg-type]
        assert any(said in text for text in changed)
    dim = [{**line, "psnr_db": 40.0} for line in lines()]
    assert any("PSNR" in text for text in worse(outcome(score(dim), seconds=1.0, trials="quick"), before))


def test_a_record_is_read_back_and_a_maimed_one_refused(tmp_path: Path) -> None:
    """Whatever is missing or of another kind, the error is the reader's, before anything is rendered."""
    whole = json.loads(result_text(outcome(score(lines(40)), seconds=1.0, trials="quick"), indent=1))
    path = tmp_path / "validation.json"
    path.write_text(json.dumps(whole))
    assert read_record(path) == whole
    for maimed in ({**whole, "models": 3}, {**whole, "psnr_db": "x"}, {"schema": whole["schema"]}, [], None):
        path.write_text(json.dumps(maimed))
        with pytest.raises(BadInputError, match="holds no validation record"):
            read_record(path)


def test_the_stored_record_is_good_and_of_what_make_validate_runs() -> None:
    """A record that says yes, of the preset that the Makefile names."""
    record = read_record(ROOT / "tests" / "validation" / "record.json")
    assert record["good"]
    assert f"validate {record['trials']} --out build/validation" in (ROOT / "Makefile").read_text()


def test_page_and_table_hold_hostile_words_harmless() -> None:
    """A reason that holds HTML is shown, not run; the table has a row a number."""
    record = lines(30)
    reason = "<script>alert(1)</script>"
    record[0] = failed(record[0], reason)
    page = page_text(score(record), record, title="<b>mine</b>", told="told")
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert table(record).count("\n") == 1 + 1 + 29 * 3
