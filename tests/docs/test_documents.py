"""README and docs do what they say: their commands are run, what they show is compared, their links lead somewhere."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from pipelines.layers import Layer, settings_of
from pipelines.settings import Settings
from toolkit.flags import Flag

from .console import DOCUMENTS, ROOT, Command, agree, blocks

MAIN = "import sys; from pipelines.cli import main; sys.exit(main())"
NAMES = [str(document.relative_to(ROOT)) for document in DOCUMENTS]
RUNNING = [name for name, document in zip(NAMES, DOCUMENTS, strict=True) if blocks(document)]


def run(command: Command, where: Path) -> tuple[int, str]:
    """Run one command in `where`; exit code, and stderr and stdout as a terminal shows them."""
    words = shlex.split(command.words)[1:]
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    done = subprocess.run(
        [sys.executable, "-c", MAIN, *words],
        cwd=where,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        check=False,
    )
    return done.returncode, done.stdout


@pytest.mark.parametrize("name", RUNNING)
def test_the_commands_of_a_document_do_what_it_shows(name: str, tmp_path: Path) -> None:
    """Each ends as shown (`$ echo $?`, else with 0) and prints the words shown; a `--help` to the letter."""
    shutil.copytree(ROOT / "docs" / "demo", tmp_path / "docs" / "demo")
    for block in blocks(ROOT / name):
        code, expected = 0, 0
        for command, after in zip(block, [*block[1:], None], strict=True):
            if not command.words.startswith("fit-material"):
                continue
            code, printed = run(command, tmp_path)
            expected = int(after.shown[0]) if after is not None and after.words == "echo $?" else 0
            assert code == expected, f"{command.words}\n{printed}"
            if "--help" in command.words:
                assert "\n".join(command.shown).strip() == printed.strip()
            assert agree(command.shown, printed), f"{command.words}\n{printed}"


def test_output_that_differs_is_seen() -> None:
    """The comparison lets numbers differ and nothing else."""
    assert agree(("a 1.0 ± 2", "b"), "a  1.5 ± 3e-4\nb\n")
    assert agree(("...", "b", "..."), "a\nb\nc\n")
    assert agree((), "anything\n")
    assert not agree(("a", "c"), "a\nb\nc\n")
    assert not agree(("a",), "a\nb\n")
    assert not agree(("b",), "a\nb\n")
    assert not agree(("a", "...", "d"), "a\nb\nc\n")


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", *NAMES[1:]])
def test_links_lead_to_files_that_are_there(name: str) -> None:
    """Every relative link."""
    document = ROOT / name
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", document.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (document.parent / target).exists(), target


def test_every_setting_is_documented() -> None:
    """docs/scene-file.md has a row for each key of each table, and its example is a valid scene."""
    text = (ROOT / "docs" / "scene-file.md").read_text(encoding="utf-8")
    for table, keys in _tables().items():
        section = re.search(rf"^## \[+{table}\]+\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
        assert section is not None, table
        for key in keys:
            assert f"`{key}`" in section[1], f"{table}.{key}"
    for example in re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        settings_of([Layer(name="example", values=tomllib.loads(example))])


def _tables() -> dict[str, set[str]]:
    """The keys of each table of the scene file, from the schema."""
    schema = Settings.model_json_schema()
    found: dict[str, set[str]] = {}
    for table, entry in schema["properties"].items():
        references = re.findall(r"#/\$defs/(\w+)", str(entry))
        found[table] = {key for name in references for key in schema["$defs"][name]["properties"]}
    return found


def test_every_flag_that_the_documents_name_exists() -> None:
    """A flag of the result that a document speaks of is one of the table."""
    of_results = [
        d
        for d in DOCUMENTS
        if d.parent.name != "models"
        and d.name not in ("adding-a-model.md", "batch.md", "doctor.md", "joint.md", "light.md", "report.md")
    ]  # those speak of code and of the files' keys
    words = {word for document in of_results for word in re.findall(r"`([a-z]\w*_\w+)`", document.read_text("utf-8"))}
    known = {str(flag) for flag in Flag}
    keys = {key for keys in _tables().values() for key in keys} | {"sd_statistical", "fit_material"}
    unknown = {word for word in words if word not in known | keys and not re.search(r"_(px|deg|rad|sd|index)$", word)}
    assert (
        unknown - {"diffuse_albedo", "reflectance_factor", "specular_albedo", "specular_strength", "specular_f0"}
        == set()
    )
