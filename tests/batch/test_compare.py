"""What changed between two results or two batches, and what did not."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.batch.compare import _change as change
from pipelines.batch.compare import compare, judged
from pipelines.batch.held import Held, hold
from pipelines.cli import main
from pipelines.report.result import result_object
from tests.pipelines import fakes
from toolkit.errors import BadInputError

from . import shoots


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    return json.loads(json.dumps(result_object(fakes.report(width_px=96, height_px=72, draws=20))))


def one(result: dict[str, Any]) -> Held:
    return Held(path=Path("x"), one=True, results={"ball": result}, pooled={})


def moved(result: dict[str, Any], sds: float) -> dict[str, Any]:
    """The same with the best fit's roughness elsewhere."""
    other = copy.deepcopy(result)
    numbers = other["fits"][other["best"]]["parameters"]["roughness_rad"]
    numbers["estimate"] += sds * numbers["sd"] * np.sqrt(2)
    return other


def test_what_moved_beyond_its_uncertainty_is_told_and_nothing_else(result: dict[str, Any]) -> None:
    """By ten sds: one number of all; by one: none."""
    far = compare(one(result), one(moved(result, 10.0)))
    assert [(c.what, round(c.z, 6)) for c in far.changed] == [("roughness_rad", 10.0)]
    assert len(far.numbers) == 13
    assert compare(one(result), one(moved(result, 1.0))).changed == []


def test_another_best_model_and_other_flags_are_remarks(result: dict[str, Any]) -> None:
    """Numbers are still compared within one model that both have."""
    other = copy.deepcopy(result)
    other["best"], other["flags"] = 3, ["poor_fit"]
    told = compare(one(result), one(other))
    assert told.changed == []
    assert [remark for _, remark in told.remarks] == [
        "best model torrance-sparrow (masking=v-groove) over lambert in A, beckmann (masking=smith) over lambert in B",
        "no longer flagged clipped",
        "newly flagged poor_fit",
    ]


def test_results_without_a_common_model_have_no_number_in_common(result: dict[str, Any]) -> None:
    """And it says so."""
    other = copy.deepcopy(result)
    for fit in other["fits"]:
        fit["diffuse"] = "wolff"
    told = compare(one(result), one(other))
    assert told.numbers == []
    assert "no model in both" in told.remarks[-1][1]


def test_chance_alone_calls_something_changed_once_in_twenty_comparisons() -> None:
    """Holm's step-down over 40 numbers of no change, 2000 times: 5 % within 4 binomial sds; a real one is seen."""
    rng = np.random.default_rng(20261123)
    alarms = 0
    for _ in range(2000):
        drafts = [change("x", "y", "m", a, 1.0, b, 1.0) for a, b in rng.standard_normal((40, 2))]
        alarms += any(c.changed for c in judged(drafts))
    assert abs(alarms / 2000 - 0.05) < 4 * np.sqrt(0.05 * 0.95 / 2000)
    assert [c.changed for c in judged([*drafts, change("x", "z", "m", 0.0, 1.0, 9.0, 1.0)])][-1]


@pytest.mark.usefixtures("plan")
def test_batches_are_paired_by_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A batch against itself shows nothing; against one of other photographs what came, went, and moved."""
    first, second = tmp_path / "first", tmp_path / "second"
    shoots.run(shoots.shoot(tmp_path / "a", 6), first)
    shoots.run(shoots.shoot(tmp_path / "b", 7, bad=(1,)), second)
    assert main(["compare", str(first), str(first), "--strict"]) == 0
    assert "changed beyond uncertainty: 0 of" in capsys.readouterr().out
    told = compare(hold(first), hold(second))
    assert told.pairs == told.same_photographs == 5
    assert told.remarks == [
        ("day1/ball006.fit", "not there in A, done in B"),
        ("day2/ball001.fit", "done in A, failed in B"),
    ]
    table = second / "batch.json"
    table.write_text(table.read_text().replace('"mean": 0.', '"mean": 9.'))
    assert main(["compare", str(first), str(second), "--json", "--strict"]) == 1
    told_json = json.loads(capsys.readouterr().out)
    assert told_json["schema"] == "fit-material/compare/1"
    assert {number["where"] for number in told_json["numbers"] if number["changed"]} == {"material paint"}


def test_what_is_no_result_is_refused_in_one_line(tmp_path: Path) -> None:
    """A missing path, another file, a batch's table of another form."""
    (tmp_path / "batch.json").write_text('{"photographs": 3}')
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "y.json").write_text("[[[")
    for path in (tmp_path / "none", tmp_path / "x", tmp_path, tmp_path / "x" / "y.json"):
        with pytest.raises(BadInputError, match="expected"):
            hold(path)
