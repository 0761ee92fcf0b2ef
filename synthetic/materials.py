"""What a sphere can be made of, for renders of known truth: lobes, their shape numbers and colours.

The named ones are in `named.py`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Floats
from toolkit.reflectance import LOBES
from toolkit.reflectance.lobe import Lobe

Number = float | Sequence[float]
FRESNEL = "specular_f0", "specular_index", "specular_strength"  # Schlick, exact dielectric, the same at every angle


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """Lobes by name; `shape` numbers of both by name; `colours` by the names of a result, (3,) each.

    radiance = E (diffuse_albedo x diffuse lobe + specular colour x specular lobe). The specular colour is
    `specular_albedo`; for a lobe with Fresnel's factor it is F(theta_d) by one of `specular_f0` (Schlick),
    `specular_index` (a clear material's refractive index, exact) or `specular_strength` (F the same at all angles).
    Raises BadInputError on names and numbers that do not fit the lobes.
    """

    model: str
    diffuse: str = "lambert"
    variant: Mapping[str, str] = field(default_factory=dict)
    shape: Mapping[str, float] = field(default_factory=dict)
    colours: Mapping[str, Floats] = field(default_factory=dict)
    name: str = ""
    source: str = ""  # where the numbers come from

    def __post_init__(self) -> None:
        _check_lobes(self)
        _check_numbers(self)
        for colour in self.colours.values():
            colour.setflags(write=False)

    @property
    def lobes(self) -> tuple[Lobe, Lobe]:
        """The diffuse and the specular lobe."""
        return LOBES[self.diffuse], LOBES[self.model]

    def shape_of(self, lobe: Lobe) -> tuple[float, ...]:
        """The shape numbers that `lobe` takes, in its own order."""
        return tuple(self.shape[parameter.name] for parameter in lobe.parameters)


def material(
    model: str,
    parameters: Mapping[str, Number],
    *,
    diffuse: str = "lambert",
    variant: Mapping[str, str] | None = None,
    name: str = "",
    source: str = "",
) -> Material:
    """A material from one flat table of numbers, as a scene file holds it; a colour's one number stands for three."""
    colours = {
        key: value for key, value in parameters.items() if key in ("diffuse_albedo", "specular_albedo", *FRESNEL)
    }
    return Material(
        model=model,
        diffuse=diffuse,
        variant=dict(variant or {}),
        shape={key: _one(key, value) for key, value in parameters.items() if key not in colours},
        colours={key: _three(key, value) for key, value in colours.items()},
        name=name,
        source=source,
    )


def _one(key: str, value: Number) -> float:
    if np.ndim(value) != 0:
        raise BadInputError(f"material.parameters.{key} is {value}; expected one number")
    return float(np.asarray(value))


def _three(key: str, value: Number) -> Floats:
    if np.shape(value) not in ((), (3,)):
        raise BadInputError(f"material.parameters.{key} is {value}; expected one number, or three for R, G, B")
    return np.broadcast_to(np.asarray(value, float), (3,)).copy()


def _check_lobes(material: Material) -> None:
    for kind, name in (("diffuse", material.diffuse), ("specular", material.model)):
        known = [lobe.name for lobe in LOBES.values() if lobe.kind == kind]
        if name not in known:
            raise BadInputError(f"{name!r} is no {kind} model; expected one of {', '.join(known)}")
    try:
        LOBES[material.model].complete(material.variant)
    except ValueError as problem:
        raise BadInputError(f"material.model: {problem}") from None


def _check_numbers(material: Material) -> None:
    wanted = {parameter.name for lobe in material.lobes for parameter in lobe.parameters}
    if set(material.shape) != wanted:
        found, expected = (", ".join(sorted(names)) or "none" for names in (material.shape, wanted))
        raise BadInputError(f"material.parameters: shape numbers {found}; expected {expected}")
    choices = FRESNEL if LOBES[material.model].fresnel else ("specular_albedo",)
    specular = [key for key in material.colours if key != "diffuse_albedo"]
    if "diffuse_albedo" not in material.colours or len(specular) != 1 or specular[0] not in choices:
        found = ", ".join(material.colours) or "none"
        raise BadInputError(f"material.parameters: colours {found}; expected diffuse_albedo and {' or '.join(choices)}")
    for parameter in (parameter for lobe in material.lobes for parameter in lobe.parameters):
        _check_range(parameter.name, material.shape[parameter.name], parameter.low, parameter.high)
    for key, colour in material.colours.items():
        _check_range(key, colour, 1.0 if key == "specular_index" else 0.0, np.inf)


def _check_range(name: str, value: float | Floats, low: float, high: float) -> None:
    numbers = np.asarray(value)
    if not (np.isfinite(numbers).all() and numbers.min() >= low and numbers.max() <= high):
        expected = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} or more"
        raise BadInputError(f"material.parameters.{name} is {numbers.tolist()}; expected {expected}")
