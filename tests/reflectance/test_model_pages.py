"""The docs pages of the models follow the register, and a new lobe gets everything by one file and one line."""

from __future__ import annotations

import doctest
import importlib
import inspect
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.laws.laws import LAWS
from toolkit import reflectance
from toolkit.reflectance import LOBES

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def maker():
    """The functions of docs/make_models.py."""
    return runpy.run_path(str(DOCS / "make_models.py"))


def test_pages_are_in_step_with_the_register(maker):
    """Every page is what the register makes of it now, and there is no page of a model that is gone."""
    made = maker["pages"]()
    assert {path.name for path in (DOCS / "models").glob("*.md")} == set(made), "run: python docs/make_models.py"
    for name, text in made.items():
        assert (DOCS / "models" / name).read_text(encoding="utf-8") == text, f"{name}: run python docs/make_models.py"


def test_every_source_is_in_the_bibliography(maker):
    """Lobes name sources that can be looked up, with author, title and year."""
    sources = maker["references"]()
    for lobe in LOBES.values():
        assert re.search(r"\w+: .+, 1[79]\d\d\.$|, 20\d\d\.$", sources[lobe.source]), lobe.name
    entries = re.findall(r"^@", (DOCS / "bibliography.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert len(entries) == len(sources)


@pytest.mark.parametrize("name", LOBES)
def test_the_manuals_example_runs(name):
    """A model file opens as its user's manual, with an example that gives what it shows."""
    module = inspect.getmodule(LOBES[name].evaluate)
    results = doctest.testmod(module)
    assert results.attempted > 0
    assert results.failed == 0


@pytest.mark.parametrize("name", LOBES)
def test_formulas_can_be_typeset(name):
    """The formula is TeX that matplotlib can typeset, but for its brackets of fixed size."""
    from matplotlib.mathtext import MathTextParser

    plain = re.sub(r"\\(bigl|bigr|Bigl|Bigr)\b", "", LOBES[name].formula).replace(r"\tfrac", r"\frac")
    MathTextParser("path").parse(f"${plain}$")


@pytest.fixture
def minnaert(tmp_path, monkeypatch):
    """The example of docs/adding-a-model.md in a temporary file, registered by one import; undone afterwards."""
    text = (DOCS / "adding-a-model.md").read_text(encoding="utf-8")
    source = next(block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "register(" in block)
    (tmp_path / "minnaert.py").write_text(source, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.import_module("minnaert")  # the one line
    yield LOBES["minnaert"], tmp_path
    del LOBES["minnaert"], sys.modules["minnaert"]


@pytest.mark.parametrize("law", LAWS)
def test_a_new_lobe_gets_the_laws(minnaert, law):
    """The example keeps every law."""
    LAWS[law](minnaert[0])


def test_a_new_lobe_gets_its_page(minnaert, maker):
    """Its page and its row in the list of models, from its registration alone."""
    made = maker["pages"]()
    assert "limb_exponent" in made["minnaert.md"]
    assert "lunar photometry" in made["minnaert.md"]
    assert "[minnaert](minnaert.md)" in made["README.md"]


def in_a_process(minnaert, *words):
    """The command line in a process of its own that imports the new file first."""
    script = "import sys, minnaert\nfrom pipelines.cli import main\nsys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", script, *words],
        cwd=DOCS.parent,
        env={"PYTHONPATH": f"{minnaert[1]}:{DOCS.parent}", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_new_lobe_gets_its_choice_on_the_command_line(minnaert):
    """`fit-material models` lists it."""
    done = in_a_process(minnaert, "models")
    assert done.returncode == 0, done.stderr
    assert "minnaert" in done.stdout
    assert "limb_exponent" in done.stdout


def test_a_new_lobe_is_fitted_by_its_name(minnaert, tmp_path):
    """`--diffuse minnaert` fits it to the demo; a name that is not registered is refused."""
    words = ["docs/demo/demo.dng", "--model", "ggx", "--preset", "quick", "--no-report", "--json", "--diffuse"]
    done = in_a_process(minnaert, *words, "minnaert", "--out", str(tmp_path / "new"))
    assert done.returncode == 0, done.stderr
    (fit,) = json.loads(done.stdout)["fits"]
    assert fit["diffuse"] == "minnaert"
    assert fit["parameters"]["limb_exponent"]["sd"] > 0
    assert in_a_process(minnaert, *words, "minnaer", "--out", str(tmp_path / "none")).returncode == 2


def test_a_name_is_taken_once(minnaert):
    """A second lobe of the same name is refused."""
    with pytest.raises(ValueError, match="exists already"):
        reflectance.register(minnaert[0])


def test_an_unknown_variant_is_refused_in_words():
    """The error names what there is."""
    with pytest.raises(ValueError, match="expected one of smith, smith-correlated, v-groove"):
        LOBES["ggx"].complete({"masking": "none"})
    with pytest.raises(ValueError, match="has no variant"):
        LOBES["lambert"].complete({"masking": "smith"})
