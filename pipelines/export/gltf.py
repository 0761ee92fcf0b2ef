"""glTF 2.0: a material with KHR_materials_ior and KHR_materials_specular, in an asset that holds nothing else.

Its specular lobe is GGX with alpha = roughnessFactor squared, its body Lambert's. What is lost: a lobe other than
GGX becomes the nearest GGX, the body's roughness goes, and the body is darkened by what the specular layer reflects.
"""

from __future__ import annotations

import json

import numpy as np

import toolkit
from toolkit.records import Floats

from .material import Material
from .register import Exporter, register


def text(material: Material) -> str:
    """The .gltf document; what was assumed stands in the material's `extras`."""
    asset = {
        "asset": {"version": "2.0", "generator": f"fit-material {toolkit.__version__}"},
        "extensionsUsed": [] if material.metal else ["KHR_materials_ior", "KHR_materials_specular"],
        "materials": [_material(material)],
    }
    if material.metal:
        del asset["extensionsUsed"]
    return json.dumps(asset, indent=1, allow_nan=False) + "\n"


def _material(material: Material) -> dict[str, object]:
    base = material.f0 if material.metal else material.diffuse
    extensions = {
        "KHR_materials_ior": {"ior": _digits(material.ior)},
        "KHR_materials_specular": {
            "specularFactor": 1.0,
            "specularColorFactor": _list(material.f0 / max(float(material.f0.max()), 1e-9)),
        },
    }
    return {
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*_list(base), 1.0],
            "metallicFactor": 1.0 if material.metal else 0.0,
            "roughnessFactor": _digits(float(np.sqrt(material.ggx.alpha))),
        },
        **({} if material.metal else {"extensions": extensions}),
        "extras": {
            "source": material.source,
            "sha256": material.sha256,
            "colourSpace": material.colour_space,
            "notes": list(material.notes),
        },
    }


def _list(values: Floats) -> list[float]:
    return [_digits(float(value)) for value in values]


def _digits(value: float) -> float:
    return float(f"{value:.9g}")


register(Exporter(name="gltf", title="glTF 2.0 material", suffix=".gltf", text=text))
