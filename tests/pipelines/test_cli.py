"""The command line with the fit itself faked: words in, exit codes, stdout, stderr and files out."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.cli.fit import COMMANDS, exit_code
from pipelines.settings import Settings
from tests.command import Run, runs
from toolkit.errors import BadInputError, FitMaterialError
from toolkit.flags import Flag
from toolkit.records import MaterialReport

from . import fakes

RESULT_KEYS = ["schema", "status", "error", "flags", "image", "camera", "noise", "scale", "reference", "colour"]
RESULT_KEYS += ["sphere", "lights", "separation", "fits", "best", "preferred", "elpd_difference", "software"]


@functools.cache
def fake_report() -> MaterialReport:
    """One whole report for all tests."""
    return fakes.report()


@dataclass
class Fake:
    """A stand-in for the main job: what it was asked, and what it answers."""

    calls: list[tuple[str, Settings]]
    answer: Callable[[Path], MaterialReport | BaseException]

    def __call__(self, asked: Sequence[tuple[Path, Settings]], *, progress: Any = None, **_: Any) -> MaterialReport:
        ((path, settings),) = asked
        self.calls.append((path.name, settings))
        if progress is not None:
            progress("fit", 0.5)
        answer = self.answer(path)
        if isinstance(answer, BaseException):
            raise answer
        return answer


def clean_report(path: Path) -> MaterialReport:
    """A converged result without flags, of the file at `path`."""
    report = fake_report()
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    image = replace(report.image, name=path.name, sha256=digest)
    return replace(report, image=image, flags=(), fits=tuple(replace(fit, flags=()) for fit in report.fits))


@pytest.fixture
def job(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Fake:
    """The main job faked, outputs without their slow files, in a folder with three images."""
    from pipelines.report import write

    fake = Fake(calls=[], answer=clean_report)
    monkeypatch.setattr("pipelines.fit_material.fit_jointly", fake)
    kept = {".json", ".settings.toml"}
    writers = write._writers
    monkeypatch.setattr(
        write, "_writers", lambda *a, **k: {name: to for name, to in writers(*a, **k).items() if name in kept}
    )
    monkeypatch.chdir(tmp_path)
    for name in ("a.dng", "b.dng", "c.dng"):
        Path(name).write_bytes(name.encode())
    return fake


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line: exit code, stdout, stderr."""
    return runs(capsys)


def one_line(text: str) -> str:
    assert text.startswith("fit-material: ")
    assert text.count("\n") == 1
    assert "Traceback" not in text
    return text.removeprefix("fit-material: ").rstrip("\n")


def test_one_image_gives_a_table_and_the_files(job: Fake, run: Run) -> None:
    """The table on stdout, nothing on stderr, results in ./STEM.fit/."""
    code, out, err = run("a.dng")
    assert (code, err) == (0, "")
    assert "roughness_rad" in out
    assert out.endswith(f"report: {Path('a.fit/a.html')}\n")
    assert json.loads(Path("a.fit/a.json").read_text())["status"] == "ok"


def test_json_prints_the_very_object_of_the_file(job: Fake, run: Run) -> None:
    """Stdout and STEM.json hold the same text."""
    code, out, err = run("a.dng", "--json", "--out", "there")
    assert (code, err) == (0, "")
    assert out == Path("there/a.json").read_text(encoding="utf-8")
    assert list(json.loads(out)) == RESULT_KEYS


def test_several_images_are_a_small_batch(job: Fake, run: Run) -> None:
    """--jsonl prints a line an image; each image has its folder."""
    code, out, _ = run("a.dng", "b.dng", "--jsonl", "--out", "all")
    assert code == 0
    assert [json.loads(line)["image"]["name"] for line in out.splitlines()] == ["a.dng", "b.dng"]
    assert Path("all/a.fit/a.json").exists()
    assert Path("all/b.fit/b.json").exists()


def test_some_failed_is_exit_4_and_the_others_are_done(job: Fake, run: Run) -> None:
    """One bad image stops no other; its line in --jsonl says why."""
    job.answer = lambda path: BadInputError("all black") if path.name == "a.dng" else clean_report(path)
    code, out, err = run("a.dng", "b.dng", "--jsonl")
    assert code == 4
    assert one_line(err) == "a.dng: all black"
    first, second = map(json.loads, out.splitlines())
    assert (first["status"], first["error"], first["image"]["name"]) == ("failed", "all black", "a.dng")
    assert second["status"] == "ok"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (BadInputError("no sphere found; expected one"), 3, "a.dng: no sphere found; expected one"),
        (FitMaterialError("the fit failed"), 1, "a.dng: the fit failed"),
        (
            ValueError("x\ny"),
            1,
            "a.dng: unexpected ValueError: x; this is a defect of fit-material, --debug shows where",
        ),
        (MemoryError(), 1, "a.dng: not enough memory for this image; expected a smaller one, or more memory"),
        (OSError(28, "No space left on device"), 1, "a.dng: No space left on device; expected"),
    ],
)
def test_a_failure_is_one_line_and_an_object(job: Fake, run: Run, error: Exception, code: int, line: str) -> None:
    """The line on stderr, the object with `error` on stdout with --json, nothing written."""
    job.answer = lambda _: error
    found, out, err = run("a.dng", "--json")
    assert found == code
    assert one_line(err).startswith(line)
    result = json.loads(out)
    assert list(result) == RESULT_KEYS
    assert result["status"] == "failed"
    assert result["error"] in one_line(err)
    assert not Path("a.fit").exists()


def test_debug_shows_the_traceback(job: Fake, run: Run) -> None:
    """Only with --debug, on stderr, the line still last."""
    job.answer = lambda _: ValueError("x")
    _, out, err = run("a.dng", "--debug")
    assert out == ""
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("fit-material: a.dng: unexpected ValueError")


def test_an_interrupt_is_130(job: Fake, run: Run) -> None:
    """Ctrl-C ends the run, not one image."""
    job.answer = lambda _: KeyboardInterrupt()
    code, out, err = run("a.dng", "b.dng")
    assert (code, out) == (130, "")
    assert one_line(err) == "interrupted"
    assert len(job.calls) == 1


def test_a_fit_that_did_not_converge_is_exit_1(job: Fake, run: Run) -> None:
    """Its result is written and shown, and says so."""

    def unconverged(path: Path) -> MaterialReport:
        report = clean_report(path)
        return replace(report, fits=tuple(replace(fit, status="not converged after 50 steps") for fit in report.fits))

    job.answer = unconverged
    code, out, err = run("a.dng")
    assert code == 1
    assert "not converged after 50 steps" in out
    assert "not converged after 50 steps" in one_line(err)
    assert json.loads(Path("a.fit/a.json").read_text())["status"] == "failed"


@pytest.mark.parametrize(("flag", "strict"), [(Flag.CLIPPED, 5), (Flag.RELATIVE_SCALE, 0), (Flag.NOT_IDENTIFIED, 0)])
def test_strict_refuses_low_quality(job: Fake, run: Run, flag: Flag, strict: int) -> None:
    """Exit 5 for a flag that a better photograph would clear, and only with --strict."""
    job.answer = lambda path: replace(clean_report(path), flags=(flag,))
    assert run("a.dng", "--overwrite")[0] == 0
    code, _, err = run("a.dng", "--overwrite", "--strict")
    assert code == strict
    assert (str(flag) in err) == (strict == 5)


@pytest.mark.parametrize(
    ("codes", "whole"),
    [([0], 0), ([0, 0], 0), ([3], 3), ([3, 3], 3), ([1, 3], 1), ([0, 3], 4), ([5], 5), ([0, 5], 5), ([5, 3], 4)],
)
def test_many_codes_become_one(codes: list[int], whole: int) -> None:
    """Some failed: 4; all failed: their own code where they agree."""
    assert exit_code(codes) == whole


def test_flags_become_settings(job: Fake, run: Run) -> None:
    """Each flag reaches its place."""
    words = (
        "a.dng --light -0.4,0.3,0.87 --light=0,0,1 --sphere 10,20,5.5 --model ggx:masking=smith --model phong "
        "--diffuse lambert --specular neutral --discrepancy off --method none --illuminant 1,0.9,0.8 "
        "--transfer srgb --fix light --seed 7 --preset careful --set fit.ess=900 --set sphere.radius_sd_px=0"
    )
    assert run(*words.split())[0] == 0
    (_, settings) = job.calls[0]
    assert [round(light.direction[0], 3) for light in settings.light] == [-0.399, 0.0]
    assert settings.sphere is not None
    assert (settings.sphere.radius_px, settings.sphere.radius_sd_px) == (5.5, 0.0)
    fit = settings.fit
    assert (fit.models, fit.diffuse, fit.specular) == (("ggx:masking=smith", "phong"), ("lambert",), "neutral")
    assert (fit.fix, fit.seed, fit.ess, fit.discrepancy) == (("light",), 7, 900, "off")
    assert (settings.separation.method, settings.separation.illuminant) == ("none", (1.0, 0.9, 0.8))
    assert settings.image.transfer == "srgb"


def test_the_sidecar_and_the_scene_file_are_read(job: Fake, run: Run) -> None:
    """`a.dng.toml` belongs to a.dng alone; --scene to all."""
    Path("a.dng.toml").write_text("[fit]\nseed = 5\n")
    Path("scene.toml").write_text("[fit]\ness = 700\n")
    assert run("a.dng", "b.dng", "--scene", "scene.toml")[0] == 0
    assert [(name, s.fit.seed, s.fit.ess) for name, s in job.calls] == [("a.dng", 5, 700), ("b.dng", 0, 700)]


def test_results_are_never_overwritten_unasked(job: Fake, run: Run) -> None:
    """Exit 2 before any work; --overwrite replaces; other files in the folder are left alone."""
    Path("a.fit").mkdir()
    Path("a.fit/notes.txt").write_text("mine")
    assert run("a.dng")[0] == 0
    code, _, err = run("a.dng")
    assert code == 2
    assert "exists; expected a new place: --out DIR, or --overwrite, or --resume" in one_line(err)
    assert len(job.calls) == 1
    assert run("a.dng", "--overwrite")[0] == 0
    assert Path("a.fit/notes.txt").read_text() == "mine"


def test_resume_keeps_what_is_finished(job: Fake, run: Run) -> None:
    """Finished results are not fitted again, their object is printed; the rest is done."""
    assert run("a.dng")[0] == 0
    code, out, _ = run("a.dng", "b.dng", "--resume", "--jsonl")
    assert code == 0
    assert [name for name, _ in job.calls] == ["a.dng", "b.dng"]
    assert [json.loads(line)["image"]["name"] for line in out.splitlines()] == ["a.dng", "b.dng"]


def test_resume_fits_again_what_was_left_unfinished(job: Fake, run: Run) -> None:
    """A folder without STEM.json holds no result."""
    assert run("a.dng")[0] == 0
    Path("a.fit/a.json").write_text('{"status": "ok", ')
    assert run("a.dng", "--resume")[0] == 0
    assert len(job.calls) == 2


@pytest.mark.parametrize("what", ["image", "settings"])
def test_resume_keeps_nothing_of_another_run(job: Fake, run: Run, what: str) -> None:
    """Another image or other settings under the same name are a usage error, not a silent old result."""
    assert run("a.dng")[0] == 0
    if what == "image":
        Path("a.dng").write_bytes(b"another")
    code, _, err = run("a.dng", "--resume", *(["--seed", "3"] if what == "settings" else []))
    assert code == 2
    assert ("another image" if what == "image" else "other settings") in one_line(err)


def test_a_dry_run_prints_the_settings_and_does_nothing(job: Fake, run: Run) -> None:
    """What it prints is a scene file."""
    code, out, _ = run("a.dng", "--seed", "9", "--dry-run")
    assert code == 0
    assert job.calls == []
    assert out.startswith("# a.dng -> a.fit\n")
    Path("scene.toml").write_text(out)
    assert run("b.dng", "--scene", "scene.toml")[0] == 0
    assert job.calls[0][1].fit.seed == 9


def test_quiet_says_nothing_and_verbose_tells_of_stages(job: Fake, run: Run) -> None:
    """-q leaves the files; -v tells on stderr."""
    assert run("a.dng", "-q") == (0, "", "")
    code, out, err = run("b.dng", "-v", "--json")
    assert code == 0
    assert json.loads(out)["status"] == "ok"
    assert err.splitlines() == ["b.dng: fit", "b.dng: writing"]


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("words", [["--json", "{}", "x"], ["a.dng", "{}"]])
def test_the_bare_name_of_a_command_is_no_image(job: Fake, run: Run, name: str, words: list[str]) -> None:
    """A file of that name must be written ./name."""
    Path(name).write_bytes(b"x")
    code, _, err = run(*(word.format(name) for word in words))
    assert code == 2
    assert f"for a file of that name write ./{name}" in one_line(err)
    assert job.calls == []


def test_a_file_named_like_a_command_can_be_fitted(job: Fake, run: Run) -> None:
    """./batch is a file."""
    Path("batch").write_bytes(b"x")
    assert run("./batch", "--out", "b.fit")[0] == 0
    assert [name for name, _ in job.calls] == ["batch"]


@pytest.mark.parametrize(
    ("words", "code", "line"),
    [
        ("", 2, "found no image; expected fit-material IMAGE"),
        ("--json", 2, "found no image"),
        ("a.dng b.dng --json", 2, "--json prints one object, found 2 images; expected --jsonl, or --joint"),
        ("a.dng --joint", 2, "--joint: found 1 different images; expected two or more"),
        ("a.dng ./a.dng --joint", 2, "--joint: found 1 different images; expected two or more"),
        ("a.dng b.dng --joint --model phong:fresnel=dielectric", 2, "phong has no variant 'fresnel'"),
        ("a.dng a.dng", 2, "several images would write to a.fit"),
        ("a.dng ./a.dng", 2, "several images would write to a.fit"),
        ("a.dng --overwrite --resume", 2, "contradict each other"),
        ("a.dng --nope", 2, "Unknown option: --nope"),
        ("a.dng --specular gold", 2, 'Invalid value "gold" for --specular. Choose from: "neutral", "coloured"'),
        ("a.dng --seed x", 2, 'unable to convert "x" into int'),
        ("a.dng --light 1,2", 2, "--light: found '1,2'; expected X,Y,Z"),
        ("a.dng --light 0,0,0", 2, "a.dng: --light: light.0: light direction"),
        ("a.dng --sphere 1,2,-3", 2, "a.dng: --sphere: sphere.radius_px is -3.0; expected a number > 0"),
        ("a.dng --sphere nan,2,3", 2, "a.dng: --sphere: sphere.centre_px.0 is NaN; expected a finite number"),
        ("a.dng --set fit.seed", 2, "expected TABLE.KEY=VALUE"),
        ("a.dng --set fit.sed=1", 2, "a.dng: --set: unknown key fit.sed; did you mean seed?"),
        ("a.dng --preset fast", 2, "expected one of careful, quick, standard"),
        ("a.dng --model gxx", 2, "'gxx' is no specular model; expected one of"),
        ("a.dng --fix lihgt", 2, 'fit.fix.0 is "lihgt"; expected'),
        ("a.dng --export obj", 2, "expected one of"),
        ("a.dng --scene none.toml", 3, "none.toml: cannot be read: No such file"),
        ("none.dng", 3, "none.dng does not exist; expected an image file"),
        (".", 3, ". is a folder; expected an image file"),
        ("a.dng --out b.dng", 2, "b.dng is a file; expected a folder"),
        ("render", 2, "SCENE requires an argument"),
    ],
)
def test_a_mistake_in_the_command_is_one_line(job: Fake, run: Run, words: str, code: int, line: str) -> None:
    """Found, expected, what to do; nothing fitted, nothing written, and an object where JSON is wanted."""
    before = sorted(Path().rglob("*"))
    found, out, err = run(*words.split())
    assert found == code
    assert line in one_line(err)
    assert job.calls == []
    assert sorted(Path().rglob("*")) == before
    assert (json.loads(out)["status"] == "failed") if "--json" in words else out == ""


def test_models_lists_the_register(run: Run) -> None:
    """Every registered lobe, its parameters and variants, in words and as an object."""
    from toolkit.reflectance import LOBES

    code, out, _ = run("models")
    assert code == 0
    for lobe in LOBES.values():
        assert f"  {lobe.name}  {lobe.title}" in out
    listed = json.loads(run("models", "--json")[1])
    assert {name: entry["kind"] for name, entry in listed.items()} == {n: lobe.kind for n, lobe in LOBES.items()}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_a_script(run: Run, shell: str) -> None:
    """For the three shells."""
    code, out, _ = run("--completion", shell)
    assert code == 0
    assert "fit-material" in out
    assert "--specular" in out


def test_version_and_help_go_to_stdout(run: Run) -> None:
    """And are good ends."""
    import toolkit

    assert run("--version") == (0, f"{toolkit.__version__}\n", "")
    code, out, err = run("--help")
    assert (code, err) == (0, "")
    assert out.startswith("Usage: fit-material IMAGE [IMAGE ...] [OPTIONS]\n")
