"""MaterialX: Autodesk's standard_surface, for Maya, Houdini, Blender, Arnold, USD.

Its specular lobe is GGX with alpha = specular_roughness squared; its body is Oren and Nayar's with the slopes' sd.
What is lost: a lobe other than GGX becomes the nearest GGX, and the body is darkened under the specular layer by
what that reflects, about F0, where the fit adds the two. The body colour is written as measured.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .material import Material
from .register import Exporter, register
from .xml_text import comment

LOSS = "standard_surface darkens the body by what its specular layer reflects (about F0); base_color is as measured"


def text(material: Material) -> str:
    """The document: a standard_surface and the surfacematerial that uses it."""
    head = comment(
        f"{material.source} (sha256 {material.sha256})", *material.notes, *(() if material.metal else (LOSS,))
    )
    lines = ["    " + _input(name, value, material) for name, value in _inputs(material).items()]
    return "\n".join(
        [
            '<?xml version="1.0" encoding="utf-8"?>',
            head.rstrip(),
            '<materialx version="1.38">',
            f'  <standard_surface name="{material.name}_surface" type="surfaceshader">',
            *lines,
            "  </standard_surface>",
            f'  <surfacematerial name="{material.name}" type="material">',
            f'    <input name="surfaceshader" type="surfaceshader" nodename="{material.name}_surface" />',
            "  </surfacematerial>",
            "</materialx>",
            "",
        ]
    )


def _inputs(material: Material) -> dict[str, float | Floats]:
    roughness = {"specular_roughness": float(np.sqrt(material.ggx.alpha))}
    if material.metal:
        return {"base": 1.0, "base_color": material.f0, "metalness": 1.0, "specular": 1.0, **roughness}
    return {
        "base": 1.0,
        "base_color": material.diffuse,
        "diffuse_roughness": min(material.diffuse_roughness_rad, 1.0),
        "metalness": 0.0,
        "specular": 1.0,
        "specular_color": material.f0 / max(float(material.f0.max()), 1e-9),
        "specular_IOR": material.ior,
        **roughness,
    }


def _input(name: str, value: float | Floats, material: Material) -> str:
    if isinstance(value, float):
        return f'<input name="{name}" type="float" value="{value:.9g}" />'
    space = ' colorspace="lin_rec709"' if material.colour_space == "linear sRGB" else ""
    return f'<input name="{name}" type="color3" value="{", ".join(f"{v:.9g}" for v in value)}"{space} />'


register(Exporter(name="materialx", title="MaterialX standard_surface", suffix=".mtlx", text=text))
