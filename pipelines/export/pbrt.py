"""pbrt-v4: one MakeNamedMaterial statement.

`coateddiffuse` is a dielectric coat over a Lambertian body, `conductor` a metal; both with the Trowbridge-Reitz
(GGX) distribution, whose alpha is `roughness` where it is not remapped. What is lost: a lobe other than GGX becomes
the nearest GGX; the coat has one index for all channels; and light that enters the coat is reflected to and fro
inside, so the body comes out darker than the albedo written.
"""

from __future__ import annotations

from toolkit.records import Floats

from .material import Material
from .register import Exporter, register

LOSS = "coateddiffuse reflects to and fro under its coat: the body comes out darker than the albedo written"


def text(material: Material) -> str:
    """Comments, the statement on one line, and how to use it."""
    notes = [*material.notes, *(() if material.metal else (LOSS,))]
    head = [f"{material.source} (sha256 {material.sha256})", *notes, f'use: NamedMaterial "{material.name}"']
    return "\n".join([*(f"# {_plain(line)}" for line in head), _statement(material), ""])


def _statement(material: Material) -> str:
    if material.metal:
        kind, colour, more = "conductor", material.f0, ""
    else:
        kind, colour, more = "coateddiffuse", material.diffuse, f' "float eta" [ {material.ior:.9g} ]'
    return (
        f'MakeNamedMaterial "{material.name}" "string type" "{kind}" "rgb reflectance" [ {_rgb(colour)} ] '
        f'"float roughness" [ {material.ggx.alpha:.9g} ] "bool remaproughness" false{more}'
    )


def _rgb(values: Floats) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _plain(line: str) -> str:
    return "".join(c for c in line if " " <= c <= "~")


register(Exporter(name="pbrt", title="pbrt-v4", suffix=".pbrt", text=text))
