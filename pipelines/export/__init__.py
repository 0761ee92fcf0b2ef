"""The fitted material for renderers. Adding a format: a file beside these, and its line below."""

from . import gltf as gltf
from . import materialx as materialx
from . import mitsuba as mitsuba
from . import pbrt as pbrt
from .material import Material, material_of
from .register import EXPORTERS, Exporter, exporter, register

__all__ = ["EXPORTERS", "Exporter", "Material", "exporter", "material_of", "register"]
