"""What a lobe says of itself, and the register that tests, documentation, command line and exports read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any, Literal

import numpy as np

from toolkit.records import Floats

from .blockwise import Piece, blockwise
from .cosines import Cosines
from .fresnel import FRESNEL

Evaluate = Callable[..., Floats]
Gradient = Callable[..., tuple[Floats, ...]]


class Claim(Enum):
    """What a lobe says is true of it; the laws in the tests hold it to that."""

    RECIPROCAL = auto()  # lobe / n.l is symmetric in light and view
    CONSERVES_ENERGY = auto()  # albedo <= 1 over the whole box of its parameters
    BOUNDED_AT_GRAZING_VIEW = auto()  # under a fixed light


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parameter:
    """One number of a lobe's shape."""

    name: str
    unit: str
    low: float
    high: float
    log: bool  # sampled and searched in its logarithm, prior uniform there
    starts: tuple[float, ...]  # where searches begin
    typical: str  # "0.02 glossy paint, 0.3 paper"
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lobe:
    """One lobe: BRDF times n.l in sr^-1, without its colour (and without F where `fresnel` is set).

    `evaluate(cosines, *shape, **variant)` returns an array of the cosines' shape, 0 where n.l or n.v is 0;
    shape numbers are floats, or arrays that broadcast. `gradient` returns the same, then its derivative in each.
    """

    name: str
    title: str
    kind: Literal["diffuse", "specular"]
    colour: Literal["diffuse_albedo", "specular_albedo", "specular_strength"]
    parameters: tuple[Parameter, ...]
    evaluate: Evaluate
    gradient: Gradient
    formula: str  # LaTeX, as the docs page shows it
    source: str  # key in docs/bibliography.bib
    sharp_angle: Literal["half", "mirror"] | None = None  # which angle carries structure as fine as the shape
    sees_source: bool = False  # its value holds the light's own disc; else a sized light is several small ones
    fresnel: bool = False  # the assembly multiplies by Fresnel's factor at theta_d
    variants: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # option -> choices, the default first:
    # those that `evaluate` takes; `options` knows of the assembly's as well
    claims: frozenset[Claim] = frozenset()  # true of every variant
    variant_claims: Mapping[tuple[str, str], frozenset[Claim]] = field(
        default_factory=dict
    )  # more, by (option, choice)

    @property
    def options(self) -> Mapping[str, tuple[str, ...]]:
        """Every option with its choices, the default first: the lobe's own, and which F the assembly multiplies by."""
        return {**self.variants, "fresnel": FRESNEL} if self.fresnel else self.variants

    def value(self, cosines: Cosines, shape: Sequence[Any], variant: Mapping[str, str] | None = None) -> Floats:
        """The lobe at `cosines` for one tuple of shape numbers."""
        chosen = self._own(variant)

        def of(piece: Piece) -> tuple[Floats, ...]:
            return (self.evaluate(cosines.part(piece), *map(piece, shape), **chosen),)

        return blockwise(of, _whole(cosines, shape))[0]

    def with_derivatives(
        self, cosines: Cosines, shape: Sequence[Any], variant: Mapping[str, str] | None = None
    ) -> tuple[Floats, ...]:
        """`value`, and its derivative in each shape number: in less time than one after the other.

        Raises TypeError where the lobe's `gradient` returns another number of arrays.
        """
        chosen = self._own(variant)

        def of(piece: Piece) -> tuple[Floats, ...]:
            found = self.gradient(cosines.part(piece), *map(piece, shape), **chosen)
            if len(found) != 1 + len(self.parameters):
                raise TypeError(
                    f"the gradient of {self.name} returned {len(found)} arrays; expected {1 + len(self.parameters)}: "
                    "the lobe's value, then its derivative in each parameter"
                )
            return found

        return blockwise(of, _whole(cosines, shape))

    def claims_of(self, variant: Mapping[str, str] | None = None) -> frozenset[Claim]:
        """What the lobe says is true of it with these options."""
        chosen = self.complete(variant).items()
        return self.claims.union(*(self.variant_claims.get(item, frozenset()) for item in chosen))

    def complete(self, variant: Mapping[str, str] | None) -> dict[str, str]:
        """The lobe's own options with the defaults filled in, and `fresnel` where it is not the default.

        Raises ValueError on one that does not exist.
        """
        options = self.options
        chosen = {option: choices[0] for option, choices in self.variants.items()}
        for option, choice in (variant or {}).items():
            if option not in options:
                raise ValueError(f"{self.name} has no variant {option!r}; it has: {', '.join(options) or 'none'}")
            if choice not in options[option]:
                raise ValueError(f"{self.name}:{option}={choice!r}; expected one of {', '.join(options[option])}")
            chosen[option] = choice
        return {o: choice for o, choice in chosen.items() if o in self.variants or choice != options[o][0]}

    def _own(self, variant: Mapping[str, str] | None) -> dict[str, str]:
        """The options that `evaluate` takes."""
        return {option: choice for option, choice in self.complete(variant).items() if option in self.variants}


def _whole(cosines: Cosines, shape: Sequence[Any]) -> tuple[int, ...]:
    return np.broadcast_shapes(cosines.n_dot_l.shape, *map(np.shape, shape))


LOBES: dict[str, Lobe] = {}


def register(lobe: Lobe) -> Lobe:
    """Add a lobe to the register; its file is imported by `toolkit.reflectance`. Raises on a name taken."""
    if lobe.name in LOBES:
        raise ValueError(f"a lobe named {lobe.name!r} exists already")
    LOBES[lobe.name] = lobe
    return lobe
