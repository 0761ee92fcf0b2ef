"""The batch as a whole: every photograph ends, what was done stays done, the bytes do not tell how it went."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.batch.inputs import photographs
from pipelines.batch.journal import NAME
from pipelines.batch.plan import Options
from pipelines.batch.whole import Ending, batch
from pipelines.settings import ColourTable, FitTable, ReferenceTable, Settings
from toolkit.errors import UsageError

from . import fake, shoots

pytestmark = pytest.mark.usefixtures("plan")


def begun(plan: Path) -> list[str]:
    """The photographs whose fit began, in order."""
    lines = (plan / "log").read_text().splitlines() if (plan / "log").exists() else []
    return [line.removeprefix("begin ") for line in lines if line.startswith("begin ")]


def test_every_photograph_ends_and_one_that_fails_stops_no_other(tmp_path: Path) -> None:
    """Results mirror the folders; the one that failed has its reason in the tables and no folder."""
    source, out = shoots.shoot(tmp_path / "shoot", 5, bad=(2,)), tmp_path / "out"
    ending = shoots.run(source, out)
    assert ending.counts == {"done": 4, "failed": 1}
    assert (out / "day2" / "ball001.fit" / "ball001.json").is_file()
    assert not (out / "day1" / "ball002.fit").exists()
    with (out / "batch.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["photograph"] for row in rows] == sorted(row["photograph"] for row in rows)
    assert [row["error"] for row in rows if row["status"] == "failed"] == [
        "ball002.dng: found a bad photograph; expected a good one"
    ]
    assert json.loads((out / "batch.json").read_bytes())["failed"] == 1


def test_resume_does_what_is_missing_and_the_bytes_are_those_of_an_unbroken_run(tmp_path: Path, plan: Path) -> None:
    """A result that is torn, missing or touched is made again, all others are kept."""
    source = shoots.shoot(tmp_path / "shoot", 6, bad=(3,))
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    shoots.run(source, whole)
    shoots.run(source, cut)
    (cut / "day1" / "ball000.fit" / "ball000.json").write_bytes(b'{"torn')
    (cut / "day2" / "ball001.fit" / "ball001.card.json").unlink()
    journal = (cut / NAME).read_bytes().splitlines(keepends=True)
    (cut / NAME).write_bytes(b"".join(journal[:-2]) + journal[-2][:20])  # the last two not noted, one of them torn
    (cut / ".fit-material-x.part").mkdir()
    (plan / "log").unlink()
    ending = shoots.run(source, cut, resume=True)
    assert sorted(begun(plan)) == ["ball000.dng", "ball001.dng"] + (
        ["ball003.dng"] if b"ball003" in journal[-1] + journal[-2] else []
    )
    assert ending.counts["done"] == 2
    assert shoots.digests(cut) == shoots.digests(whole)
    assert not list(cut.rglob(".fit-material-*"))


def test_a_resumed_batch_that_misses_nothing_fits_nothing(tmp_path: Path, plan: Path) -> None:
    """Failures that would come again are kept as well."""
    source, out = shoots.shoot(tmp_path / "shoot", 4, bad=(0,)), tmp_path / "out"
    shoots.run(source, out)
    before = shoots.digests(out)
    (plan / "log").unlink()
    ending = shoots.run(source, out, resume=True)
    assert begun(plan) == []
    assert ending.counts == {"kept": 3, "failed": 1}
    assert shoots.digests(out) == before


def test_a_worker_that_died_while_writing_leaves_nothing(tmp_path: Path) -> None:
    """What it had half made beside its place goes, at the latest as the batch ends."""
    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"

    def ended(item: object, outcome: object) -> None:
        (out / "day1" / ".fit-material-x.part").mkdir(exist_ok=True)
        (out / "day1" / ".fit-material-x.part" / "ball000.json").write_bytes(b'{"half')

    shoots.run(source, out, ended=ended)
    assert not list(out.rglob(".fit-material-*"))
    assert (out / "batch.json").is_file()


def test_new_photographs_join_on_resume(tmp_path: Path, plan: Path) -> None:
    """Only those are fitted."""
    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"
    shoots.run(source, out)
    shoots.shoot(source, 3)
    (plan / "log").unlink()
    assert shoots.run(source, out, resume=True).counts == {"kept": 2, "done": 1}
    assert begun(plan) == ["ball002.dng"]


def refuse(match: str, *args: Any, **options: Any) -> None:
    with pytest.raises(UsageError, match=match):
        shoots.run(*args, **options)


def test_what_is_there_is_neither_overwritten_nor_mixed(tmp_path: Path) -> None:
    """Without --resume, with another version, with other settings: refused; --overwrite begins anew."""
    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"
    shoots.run(source, out)
    before = shoots.digests(out)
    refuse("holds a batch", source, out)
    refuse("results of fit-material 1.2.3, this is 1.3.0", source, out, resume=True, version="1.3.0")
    other = Settings(fit=FitTable(seed=7))
    refuse("other settings", source, out, resume=True, settings_for=lambda one: other)
    refuse("other settings or outputs", source, out, resume=True, exports=("pbrt",))
    assert shoots.digests(out) == before
    assert shoots.run(source, out, overwrite=True).counts == {"done": 2}
    assert shoots.digests(out) == before


def test_a_photograph_that_changed_is_not_taken_for_the_old_one(tmp_path: Path) -> None:
    """It fails with a line that says so; its old result stays."""
    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"
    shoots.run(source, out)
    (source / "day1" / "ball000.dng").write_bytes(b"good, but another")
    for _ in range(2):
        ending = shoots.run(source, out, resume=True)
        assert "has changed since it was fitted" in ending.outcomes[0].error
        assert ending.outcomes[1].status == "kept"


def test_a_card_that_changed_is_other_settings(tmp_path: Path, plan: Path) -> None:
    """As a scene file's other words are: refused while it is another one; the first one's bytes are kept."""
    source, out = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out"
    card, chart = tmp_path / "card.dng", tmp_path / "chart.dng"
    card.write_bytes(b"grey")
    chart.write_bytes(b"colours")
    reference = ReferenceTable(grey=(0.18, 0.18, 0.18), box_px=(0, 0, 9, 9), file=str(card))
    told = Settings(reference=reference, colour=ColourTable(chart=str(chart)))
    asked = {"settings_for": lambda one: told}
    shoots.run(source, out, **asked)
    before = shoots.digests(out)
    for path in (card, chart):
        held = path.read_bytes()
        path.write_bytes(held + b", but another")
        refuse("other settings", source, out, resume=True, **asked)
        path.unlink()
        refuse("other settings", source, out, resume=True, **asked)
        path.write_bytes(held)
        assert shoots.run(source, out, resume=True, **asked).counts == {"kept": 2}
    assert shoots.digests(out) == before


def test_what_failed_without_its_card_is_fitted_once_it_is_there(tmp_path: Path, plan: Path) -> None:
    """Where there is no result, there is nothing to mix."""
    source, out, card = shoots.shoot(tmp_path / "shoot", 2, bad=(1,)), tmp_path / "out", tmp_path / "card.dng"
    reference = ReferenceTable(grey=(0.18, 0.18, 0.18), box_px=(0, 0, 9, 9), file=str(card))
    own = {"day2": Settings(reference=reference), "day1": Settings()}
    asked = {"settings_for": lambda one: own[one.path.parent.name]}
    assert shoots.run(source, out, **asked).counts == {"done": 1, "failed": 1}
    (plan / "log").unlink()
    shoots.run(source, out, resume=True, **asked)
    assert begun(plan) == []
    card.write_bytes(b"grey")
    shoots.run(source, out, resume=True, **asked)
    assert begun(plan) == ["ball001.dng"]


def test_two_batches_do_not_write_into_one_folder(tmp_path: Path) -> None:
    """The second is refused while the first runs."""
    source, out = shoots.shoot(tmp_path / "shoot", 1), tmp_path / "out"
    refused = []

    def ended(item: object, outcome: object) -> None:
        with pytest.raises(UsageError, match="another batch is writing") as caught:
            shoots.run(source, out, resume=True)
        refused.append(caught)

    shoots.run(source, out, ended=ended)
    assert len(refused) == 1


def test_a_folder_with_other_things_in_it_is_left_alone(tmp_path: Path) -> None:
    """A batch begins in a new or empty folder, unless --overwrite says otherwise."""
    source, out = shoots.shoot(tmp_path / "shoot", 1), tmp_path / "out"
    out.mkdir()
    (out / "thesis.txt").write_text("years")
    refuse("is not empty", source, out)
    refuse("is not empty", source, out, resume=True)
    shoots.run(source, out, overwrite=True)
    assert (out / "thesis.txt").read_text() == "years"


def test_no_result_leaves_the_folder_through_a_link(tmp_path: Path) -> None:
    """A link in the batch's folder that leads elsewhere fails its photographs."""
    source, out, elsewhere = shoots.shoot(tmp_path / "shoot", 2), tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (out / "day1").symlink_to(elsewhere)
    ending = shoots.run(source, out, overwrite=True)
    assert "leads out of" in ending.outcomes[0].error
    assert ending.outcomes[1].status == "done"
    assert list(elsewhere.iterdir()) == []


def joined(source: Path, out: Path, *groups: str, materials: str = "xxxxx", seeds: str = "00000") -> Ending:
    """A batch of five photographs of these groups, materials and seeds."""
    found = photographs([str(source)])
    told = [replace(one, group=g, material=m) for one, g, m in zip(found, groups, materials, strict=True)]
    own = {one.path: Settings(fit=FitTable(seed=int(seed))) for one, seed in zip(found, seeds, strict=True)}
    options = Options(out=out, settings_for=lambda one: own[one.path], version="1", page=False, resume=out.exists())
    return batch(told, options, shoots.INLINE, ended=lambda item, outcome: None, note=print, work=fake.work)


def test_photographs_of_one_group_are_one_fit(tmp_path: Path, plan: Path) -> None:
    """Where the first of them stands, with every one's settings; of no group each is its own; --resume knows all."""
    source, out = shoots.shoot(tmp_path / "shoot", 5), tmp_path / "out"
    ending = joined(source, out, "a", "", "a", "", "a")
    names = [[one.path.name for one in item.photographs] for item in ending.items]
    assert names == [["ball000.dng", "ball004.dng", "ball003.dng"], ["ball002.dng"], ["ball001.dng"]]
    assert ending.counts == {"done": 3}
    assert begun(plan)[:3] == names[0]
    assert (out / "day1" / "ball000.fit" / "ball000.settings-3.toml").is_file()
    (row, *_) = json.loads((out / "batch.json").read_bytes())["photographs"]
    assert (row["photograph"], row["group"]) == ("day1/ball000.dng + day1/ball004.dng + day2/ball003.dng", "a")
    assert joined(source, out, "a", "", "a", "", "a").counts == {"kept": 3}
    (source / "day2" / "ball003.dng").write_bytes(b"good, but another")
    assert "ball003.dng has changed" in joined(source, out, "a", "", "a", "", "a").outcomes[0].error


def test_a_group_that_cannot_be_one_fit_fails_alone(tmp_path: Path) -> None:
    """Photographs of two materials, or fitted by other rules."""
    source = shoots.shoot(tmp_path / "shoot", 5)
    groups = ("a", "a", "b", "b", "")
    ending = joined(source, tmp_path / "out", *groups, materials="xyxxx", seeds="00011")
    assert [outcome.status for outcome in ending.outcomes] == ["failed", "failed", "done"]
    assert "group a: found the materials x, y; expected one" in ending.outcomes[0].error
    assert "group b: [fit] of ball001.dng differs from that of ball004.dng" in ending.outcomes[1].error
