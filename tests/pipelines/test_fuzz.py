"""Scene files, sidecars and flags that nobody would write: one line and the right exit code, or a scene that holds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipelines.cli import main
from pipelines.layers import resolve
from pipelines.locate import locate
from tests.io import good
from toolkit.errors import BadInputError
from toolkit.io.read import read_in_process
from toolkit.records import RawFrame

from .mistakes import SCENE

WHOLE = SCENE.replace("[material]", "[camera]\nprojection = 'perspective'\nfocal_length_px = 4000.0\n[material]") + (
    "[fit]\nmodels = ['ggx:masking=smith']\nfix = ['radius']\ness = 500\nseed = 1\n"
    "[separation]\nmethod = 'dichromatic'\nilluminant = [1.0, 0.9, 0.8]\n"
)
ODD = ["nan", "-inf", "0", "-1", "1e308", "-1e308", "1e-308", "99999999999999999999", "''", "true", "[]", "[1]", "{}"]
ODD += ["1979-05-27", "0x10", "'\\u0000'", "[[[[]]]]", "1e400", "-0.0", "{a=1}"]
NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The photograph of the scene, nothing beside it."""
    made = tmp_path_factory.mktemp("fuzz")
    (made / "scene.toml").write_text(SCENE)
    assert main(["render", str(made / "scene.toml"), "--out", str(made / "ball.dng")]) == 0
    (made / "ball.dng.toml").unlink()
    return made / "ball.dng"


def scene_mutant(rng: np.random.Generator) -> bytes:
    """The whole scene file with bytes damaged, or with one to three of its numbers replaced by odd values."""
    if rng.random() < 0.3:
        return good.mutant(WHOLE.encode(), rng)
    text = WHOLE
    for _ in range(int(rng.integers(1, 4))):
        places = list(NUMBER.finditer(text))
        place = places[int(rng.integers(0, len(places)))]
        text = text[: place.start()] + str(rng.choice(ODD)) + text[place.end() :]
    return text.encode()


def outcome(image: Path, frame: RawFrame, scene: Path | None) -> str:
    """The error's line, or nothing where the scene holds."""
    try:
        locate(frame, resolve(image, scene=scene))
    except BadInputError as error:
        return str(error)
    return ""


def check_scenes(ball: Path, count: int, seed: int) -> None:
    """Every other mutant as a sidecar; a defect is any other exception, a warning too."""
    frame, rng = read_in_process(ball), np.random.default_rng(seed)
    sidecar, scene = ball.with_name("ball.dng.toml"), ball.with_name("mutant.toml")
    said = 0
    for number in range(count):
        path = sidecar if number % 2 else scene
        path.write_bytes(scene_mutant(rng))
        line = outcome(ball, frame, None if number % 2 else scene)
        path.unlink()
        assert "\n" not in line, line
        assert len(line) < 500, line
        assert line == "" or line.isprintable(), line
        said += bool(line)
    assert 0.2 * count < said < 0.98 * count  # both ends are reached


def test_mutants_of_scenes_and_sidecars(ball: Path) -> None:
    """250 of them."""
    check_scenes(ball, 250, seed=1)


@pytest.mark.slow
def test_many_mutants_of_scenes_and_sidecars(ball: Path) -> None:
    """4,000 of them."""
    check_scenes(ball, 4000, seed=2)


odd_numbers = st.one_of(st.floats(), st.integers(-(10**400), 10**400), st.text(max_size=8)).map(str)
triples = st.lists(odd_numbers, min_size=1, max_size=4).map(",".join)
keys = st.sampled_from(
    ["fit.ess", "fit.models", "sphere.radius_px", "light.0.direction", "light", "camera", "noise.gain"]
)
values = st.one_of(st.text(max_size=12), st.sampled_from(ODD), triples)
assignments = st.one_of(st.text(max_size=20), st.tuples(st.one_of(keys, st.text(max_size=12)), values).map("=".join))
flags = st.one_of(
    st.tuples(st.sampled_from(["--light", "--sphere", "--illuminant"]), triples),
    st.tuples(st.just("--set"), assignments),
    st.tuples(
        st.sampled_from(["--model", "--diffuse", "--fix", "--preset", "--seed", "--method"]), st.text(max_size=12)
    ),
).map("=".join)


@settings(max_examples=80, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(words=st.lists(flags, min_size=1, max_size=3))
def test_odd_flags_are_usage_in_one_line(ball: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    """Exit 2 and one line, or settings that are planned; a file is never blamed for a flag."""
    capsys.readouterr()
    code = main([str(ball), "--dry-run", *words])
    out, err = capsys.readouterr()
    assert code in (0, 2), (words, err)
    assert "unexpected" not in err
    assert "Traceback" not in err
    assert (err.count("\n"), bool(out)) == ((0, True) if code == 0 else (1, False)), (words, err)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(words=st.lists(st.one_of(flags, st.text(max_size=10)), max_size=4))
def test_odd_words_never_crash(words: list[str]) -> None:
    """Anything at all in place of images: a line and an exit code of the table."""
    assert main([*words, "--dry-run"]) in (0, 2, 3, 4, 1)
