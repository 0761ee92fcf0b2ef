"""What the words of the command line name, and where the results go."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipelines.batch.inputs import photographs
from pipelines.batch.photograph import Photograph
from pipelines.batch.places import inside, places
from toolkit.errors import BadInputError, UsageError


@pytest.fixture
def shoot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two days of photographs, and what lies about in such folders."""
    monkeypatch.chdir(tmp_path)
    for name in ("day1/b.dng", "day1/a.DNG", "day2/c.png", "day1/a.DNG.toml", "day1/notes.txt", "day1/.hidden.dng"):
        path = tmp_path / "shoot" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    for name in ("shoot/a.fit/a.layers.exr", "shoot/out/b.fit/b.layers.exr", "shoot/out/x.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    return tmp_path / "shoot"


def under(found: list[Photograph]) -> list[str]:
    return ["/".join(one.under) for one in found]


def test_a_folder_stands_for_its_photographs(shoot: Path) -> None:
    """In order, without sidecars, hidden files, results and the batch's own folder."""
    found = photographs(["shoot"], leave_out=Path("shoot/out"))
    assert under(found) == ["day1/a.DNG", "day1/b.dng", "day2/c.png"]
    assert all(one.path.is_file() for one in found)


def test_globs_mirror_what_lies_below_their_plain_part(shoot: Path) -> None:
    """Also recursive ones; a file whose name looks like a glob is a file."""
    assert under(photographs(["shoot/*/*.dng"], leave_out=Path("shoot/out"))) == ["day1/b.dng"]
    assert under(photographs(["shoot/**/*.[pd]n*"], leave_out=Path("shoot/out"))) == ["day1/b.dng", "day2/c.png"]
    (shoot / "x[1].dng").write_bytes(b"x")
    assert under(photographs(["shoot/x[1].dng"])) == ["shoot/x[1].dng"]


def test_files_are_mirrored_as_written_and_counted_once(shoot: Path) -> None:
    """A relative path keeps its folders; an absolute one, or one that climbs, its name."""
    found = photographs(["shoot/day1/b.dng", "./shoot/day1/b.dng", str(shoot / "day2" / "c.png"), "shoot"])
    assert under(found)[:2] == ["shoot/day1/b.dng", "c.png"]
    assert len(found) == len({one.path.resolve() for one in found})
    os.chdir(shoot / "day1")
    assert under(photographs(["../day2/c.png"])) == ["c.png"]


def test_lists_come_from_files_and_from_stdin(shoot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One path a line, or separated by zero bytes where names may hold line ends."""
    Path("list").write_bytes(b"shoot/day1/b.dng\r\n\r\nshoot/day2/c.png\n")
    assert under(photographs([], files_from="list")) == ["shoot/day1/b.dng", "shoot/day2/c.png"]
    stdin = io.TextIOWrapper(io.BytesIO(b"shoot/day1/b.dng\0od\nd.dng\0\xff.dng"))
    monkeypatch.setattr(sys, "stdin", stdin)
    assert under(photographs([], files_from="-")) == ["shoot/day1/b.dng", "od\nd.dng", "\udcff.dng"]
    with pytest.raises(BadInputError, match="expected a file of paths"):
        photographs([], files_from="none")


def test_nothing_found_is_a_mistake(shoot: Path) -> None:
    """An empty folder, a glob without a match is taken for a file that is not there."""
    (shoot / "empty").mkdir()
    with pytest.raises(UsageError, match="found no photograph"):
        photographs(["shoot/empty"])
    with pytest.raises(UsageError, match="found no photograph"):
        photographs(["shoot/*.nef"])


CSV = 'image,scene,material,light\n"day1/b.dng",rig.toml,red paint,"0.4,0.3,0.87"\nday2/c.png,,,\n'


@pytest.mark.parametrize(
    "text", [CSV, "\ufeff" + CSV.replace("\n", "\r\n"), CSV.replace(",", ";").replace("0.4;0.3;0.87", "0.4,0.3,0.87")]
)
def test_a_manifest_is_a_table(shoot: Path, text: str) -> None:
    """With commas, semicolons, a byte order mark; paths from its own folder; empty cells say nothing."""
    (shoot / "m.csv").write_bytes(text.encode())
    first, second = photographs([str(shoot / "m.csv")])
    assert (first.path, first.scene, first.material) == (shoot / "day1/b.dng", shoot / "rig.toml", "red paint")
    assert first.settings == {"light": [{"kind": "directional", "direction": [0.4, 0.3, 0.87]}]}
    assert (second.scene, second.material, second.settings) == (None, "", {})
    assert under([first, second]) == ["day1/b.dng", "day2/c.png"]


def test_a_manifest_in_toml_may_hold_settings(shoot: Path) -> None:
    """Any of a scene file's, beside the columns."""
    (shoot / "m.toml").write_text(
        '[[photograph]]\nimage = "day1/b.dng"\ngroup = "g"\nsphere = "1,2,3"\n'
        "[photograph.settings]\nnoise = {gain = 1, read = 2}\n"
    )
    (one,) = photographs([str(shoot / "m.toml")])
    assert one.group == "g"
    assert one.settings == {"sphere": {"centre_px": [1, 2], "radius_px": 3}, "noise": {"gain": 1, "read": 2}}


BAD: dict[str, Any] = {
    "m.csv": {
        "": "found the columns nothing",
        "name\nx": "found the columns name",
        "image,image\nx,y": "found the columns",
        "image,colour\nx,y": "colour",
        "image,scene\nx": "line 2: found another number of cells",
        "image\nx,y": "line 2: found another number of cells",
        "image,material\n,red": "line 2: found no image",
        'image,light\nx,"1,2"': "line 2: light: found '1,2'",
        'image\n"x': "expected a table",
        "image\n\0": "expected",
        b"image\n\xff": "expected a table of UTF-8",
    },
    "m.toml": {
        "": "found nothing",
        "[sphere]\nradius_px = 3": "found sphere",
        "photograph = 3": "expected [[photograph]]",
        "photograph = [3]": "photograph 1: found 3",
        "[[photograph]]\nimage = 3": "image is 3; expected text",
        '[[photograph]]\nimage = "x"\nsettings = "y"': "expected a table",
        '[[photograph]]\nimage = "x"\ncolour = "y"': "found the key colour",
        "[[photograph": "expected a manifest in TOML",
        "a=" + "[" * 5000: "expected a manifest in TOML",
    },
}


@pytest.mark.parametrize(
    ("name", "text"), [(name, text) for name, cases in BAD.items() for text in cases], ids=range(20)
)
def test_a_manifest_that_says_nothing_useful_is_refused_in_one_line(
    tmp_path: Path, name: str, text: str | bytes
) -> None:
    """Which names the line or the table, what was found and what is expected."""
    (tmp_path / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises((BadInputError, UsageError)) as caught:
        photographs([str(tmp_path / name)])
    assert BAD[name][text] in str(caught.value)
    assert "\n" not in str(caught.value)


def of(*parts: str, path: str = "") -> Photograph:
    return Photograph(path=Path(path or "/".join(parts)), under=parts)


def test_places_mirror_the_inputs_paths() -> None:
    """The suffix goes, `.fit` comes; what would meet is told apart by its own path, whatever else is in the batch."""
    assert list(map(str, places([of("day1", "a.dng"), of("day2", "a.dng")]))) == ["day1/a.fit", "day2/a.fit"]
    meeting = places([of("d", "a.dng"), of("d", "a.png"), of("d", "b.dng")])
    again = places([of("d", "b.dng"), of("d", "a.png"), of("d", "a.dng")])
    assert len(set(meeting)) == 3
    assert str(meeting[2]) == "d/b.fit"
    assert set(meeting) == set(again)
    assert len(set(places([of("a.dng", path="/x/a.dng"), of("a.dng", path="/y/a.dng")]))) == 2


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.text(max_size=12), st.text(min_size=1, max_size=12)), min_size=1, max_size=6, unique=True))
def test_whatever_the_names_the_places_are_inside_and_apart(names: list[tuple[str, str]]) -> None:
    """Any text: relative, no dots, no reserved name, no two alike where case does not count."""
    found = places([of(folder, name, path=f"/{number}/x") for number, (folder, name) in enumerate(names)])
    assert len({str(place).casefold() for place in found}) == len(found)
    for place in found:
        assert not place.is_absolute()
        assert not {"", ".", ".."} & set(place.parts)
        assert place.name.endswith(".fit")
        assert not place.parts[0].startswith("batch.") or place.parts[0].endswith(".fit")


def test_a_place_behind_a_link_is_refused(tmp_path: Path) -> None:
    """Where the link leads out; one that stays inside is taken."""
    (tmp_path / "out" / "a").mkdir(parents=True)
    (tmp_path / "out" / "b").symlink_to(tmp_path / "out" / "a")
    (tmp_path / "out" / "c").symlink_to(tmp_path)
    out = tmp_path / "out"
    from pathlib import PurePosixPath

    assert inside(out, PurePosixPath("b/x.fit")) == out / "b" / "x.fit"
    with pytest.raises(BadInputError, match="leads out of"):
        inside(out, PurePosixPath("c/x.fit"))
