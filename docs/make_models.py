"""Writes docs/models from the register of lobes: a page a model, and a list of them.

usage: python docs/make_models.py
A page is the lobe's own manual (its file's docstring), its formula, its table of parameters, its variants with what
each claims, and its source. A test compares the pages with the register.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from toolkit.reflectance import LOBES, Claim, Lobe, Parameter

HERE = Path(__file__).resolve().parent
CLAIMS = {
    Claim.RECIPROCAL: "reciprocal",
    Claim.CONSERVES_ENERGY: "conserves energy",
    Claim.BOUNDED_AT_GRAZING_VIEW: "bounded at grazing view",
}
MULTIPLIES = {
    "diffuse_albedo": "`diffuse_albedo`, the body's colour",
    "specular_albedo": "`specular_albedo`, the lecture's rho_s",
    "specular_strength": "`specular_strength`, and Fresnel's factor at theta_d through `specular_f0`",
}


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    sources = references()
    made = {f"{lobe.name}.md": page(lobe, sources) for lobe in LOBES.values()}
    return made | {"README.md": contents()}


def contents() -> str:
    """The list of models."""
    lines = ["# Models", "", "Written by `docs/make_models.py` from the register of lobes.", ""]
    for kind in ("specular", "diffuse"):
        lines += [f"## {kind.capitalize()}", "", "| model | shape | source |", "|---|---|---|"]
        for lobe in sorted(LOBES.values(), key=lambda lobe: lobe.name):
            if lobe.kind == kind:
                shape = ", ".join(f"`{p.name}`" for p in lobe.parameters) or "none"
                lines.append(f"| [{lobe.name}]({lobe.name}.md) | {shape} | {lobe.source} |")
        lines.append("")
    return "\n".join(lines)


def page(lobe: Lobe, sources: dict[str, str]) -> str:
    """One model's page; raises KeyError where the bibliography lacks its source."""
    parts = [f"# {lobe.title}", f"`{lobe.name}`, a {lobe.kind} lobe: the BRDF times the cosine n.l, in sr^-1."]
    parts += [manual(lobe), "## Formula", f"$$ {lobe.formula} $$", f"It is multiplied by {MULTIPLIES[lobe.colour]}."]
    parts += ["## Shape", table(lobe.parameters)]
    parts += ["## Variants" if lobe.variants else "## Claims", claims(lobe)]
    parts += ["## Source", sources[lobe.source]]
    return "\n\n".join(parts) + "\n"


def manual(lobe: Lobe) -> str:
    """The docstring of the lobe's file, without its first line's repetition of the name."""
    module = inspect.getmodule(lobe.evaluate)
    return inspect.cleandoc((module and module.__doc__) or f"{lobe.title}.")


def table(parameters: tuple[Parameter, ...]) -> str:
    """The parameters, one a row."""
    if not parameters:
        return "None: the colour is all that is fitted."
    rows = ["| name | unit | range | searched and sampled | typical | meaning |", "|---|---|---|---|---|---|"]
    for p in parameters:
        scale = "in its logarithm" if p.log else "linearly"
        rows.append(f"| `{p.name}` | {p.unit} | {p.low:g} to {p.high:g} | {scale} | {p.typical} | {p.meaning} |")
    return "\n".join(rows)


def claims(lobe: Lobe) -> str:
    """What the laws in the tests hold the lobe to, by variant."""
    if not lobe.variants:
        return _in_words(lobe, {})
    rows = ["| option | claims |", "|---|---|"]
    for option, choices in lobe.variants.items():
        for choice in choices:
            default = " (default)" if choice == choices[0] else ""
            rows.append(f"| `{option}={choice}`{default} | {_in_words(lobe, {option: choice})} |")
    return "\n".join(rows)


def _in_words(lobe: Lobe, variant: dict[str, str]) -> str:
    held = lobe.claims_of(variant)
    return ", ".join(words for claim, words in CLAIMS.items() if claim in held) or "none"


def references() -> dict[str, str]:
    """The bibliography as sentences, by key."""
    text = (HERE / "bibliography.bib").read_text(encoding="utf-8")
    return {key: _sentence(body) for key, body in re.findall(r"^@\w+\{(\w+), (.*)\}$", text, re.MULTILINE)}


def _sentence(body: str) -> str:
    entry = dict(re.findall(r"(\w+) = \{((?:[^{}]|\{[^{}]*\})*)\}", body))
    plain = {k: v.replace('{\\"u}', "ü").replace("{\\'c}", "ć").replace("--", "-") for k, v in entry.items()}
    plain = {
        k: re.sub(r"[{}]", "", v).replace(" and ", ", ") if k == "author" else re.sub(r"[{}]", "", v)
        for k, v in plain.items()
    }
    where = next(
        (plain[k] for k in ("journal", "booktitle", "publisher", "institution", "howpublished") if k in plain), ""
    )
    number = f" {plain['volume']}" + (f"({plain['number']})" if "number" in plain else "") if "volume" in plain else ""
    leaves = f", {plain['pages']}" if "pages" in plain else ""
    return f"{plain['author']}: {plain['title']}. {where}{number}{leaves}, {plain['year']}.".replace(" , ", " ")


def main() -> None:
    """Write every page, and remove those of models that are gone."""
    folder = HERE / "models"
    folder.mkdir(exist_ok=True)
    made = pages()
    for old in folder.glob("*.md"):
        if old.name not in made:
            old.unlink()
    for name, text in made.items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
