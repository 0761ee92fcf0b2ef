"""Mitsuba 3: a BSDF that adds the diffuse and the specular lobe just as they were fitted.

`roughplastic` would not do: its body is not Lambertian. A `blendbsdf` of weight w adds (1 - w) x diffuse and
w x specular, so each part is divided by its share. The specular part is a `roughconductor`: with k = 0 its
Fresnel factor is the dielectric one. Exact for `beckmann` and `ggx` with Smith's masking over `lambert`.
"""

from __future__ import annotations

import numpy as np

from toolkit.records import Floats

from .conductor import complex_index
from .material import Material
from .register import Exporter, register
from .xml_text import comment

NEUTRAL = 0.02  # channels this close together are written as one number, which the spectral variants read as well


def text(material: Material) -> str:
    """The scene snippet: one `bsdf` element with an id, to be included in a scene or loaded by itself."""
    body = float(material.diffuse.max())
    head = comment(
        f"{material.source} (sha256 {material.sha256}), colours in {material.colour_space}", *material.notes,
        "for Mitsuba's rgb variants" if not _neutral(material.f0) else "for all of Mitsuba's variants",
    )  # fmt: skip
    if body < 1e-4:
        bsdf = _conductor(material, gain=1.0, attributes=f' id="{material.name}" version="3.0.0"')
        return head + "\n".join(bsdf) + "\n"
    share = float(np.clip(1.0 - body, 0.05, 0.95))  # of the specular part: leaves the body's reflectance within 0 .. 1
    lines = [
        f'<bsdf type="blendbsdf" id="{material.name}" version="3.0.0">',
        f'    <float name="weight" value="{share:.9g}"/>',
        '    <bsdf type="diffuse">',
        f'        <rgb name="reflectance" value="{_rgb(np.minimum(material.diffuse / (1.0 - share), 1.0))}"/>',
        "    </bsdf>",
        *("    " + line for line in _conductor(material, gain=1.0 / share)),
        "</bsdf>",
    ]
    return head + "\n".join(lines) + "\n"


def _conductor(material: Material, *, gain: float, attributes: str = "") -> list[str]:
    lobe = material.nearest
    eta, k = complex_index(material.f0)
    return [
        f'<bsdf type="roughconductor"{attributes}>',
        f'    <string name="distribution" value="{lobe.distribution}"/>',
        f'    <float name="alpha" value="{lobe.alpha:.9g}"/>',
        f"    {_index('eta', eta)}",
        f"    {_index('k', k)}",
        f'    <float name="specular_reflectance" value="{gain:.9g}"/>',
        "</bsdf>",
    ]


def _index(name: str, values: Floats) -> str:
    if _neutral(values):
        return f'<float name="{name}" value="{values.mean():.9g}"/>'
    return f'<rgb name="{name}" value="{_rgb(values)}"/>'


def _neutral(values: Floats) -> bool:
    return bool(values.max() - values.min() <= NEUTRAL * values.max())


def _rgb(values: Floats) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


register(Exporter(name="mitsuba", title="Mitsuba 3", suffix=".mitsuba.xml", text=text))
