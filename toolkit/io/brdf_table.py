"""Measured reflectance as Cornell's Program of Computer Graphics published it: a text table of directions and spectra.

Lines that begin with # are remarks. The first number is the count of wavelengths, then come the wavelengths in nm, then
one measurement a line: theta_i, phi_i, theta_s, phi_s in radians, and the BRDF in sr^-1 at each wavelength.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from toolkit.errors import BadInputError
from toolkit.records import Floats, readonly

LARGEST_BYTES = 64_000_000
MOST_WAVELENGTHS = 1000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredTable:
    """Directions (N, 3) of light and view over a surface that faces up, and the BRDF (N, wavelengths) in sr^-1."""

    name: str
    light: Floats
    view: Floats
    wavelength_nm: Floats
    brdf: Floats

    def __post_init__(self) -> None:
        readonly(self)

    def bands(self, edges_nm: tuple[float, ...] = (400.0, 500.0, 600.0, 701.0)) -> Floats:
        """The BRDF averaged over wavelengths between edges: (N, len(edges) - 1); raises where a band is empty."""
        inside = [(self.wavelength_nm >= a) & (self.wavelength_nm < b) for a, b in pairwise(edges_nm)]
        if not all(band.any() for band in inside):
            raise BadInputError(f"{self.name}: no wavelength in one of the bands {edges_nm} nm")
        return np.stack([self.brdf[:, band].mean(axis=1) for band in inside], axis=1)


def read_brdf_table(path: Path) -> MeasuredTable:
    """Read one table; raises BadInputError on what is none."""
    numbers = _numbers(path)
    count = int(numbers[0][0]) if numbers and numbers[0] and numbers[0][0].is_integer() else 0
    if not 0 < count <= MOST_WAVELENGTHS or len(numbers[0]) != 1:
        raise BadInputError(f"{path.name}: found no count of wavelengths; expected a table of measured reflectance")
    wavelengths, rest = _take(numbers[1:], count, path)
    short = next((row for row in rest if len(row) != 4 + count), None)
    if short is not None or not rest:
        found = "no measurements" if short is None else f"a line of {len(short)} numbers"
        raise BadInputError(f"{path.name}: found {found}; expected four angles and {count} values a line")
    table = np.array(rest)
    _check(path, wavelengths, table)
    return MeasuredTable(
        name=path.stem,
        light=_direction(table[:, 0], table[:, 1]),
        view=_direction(table[:, 2], table[:, 3]),
        wavelength_nm=wavelengths,
        brdf=table[:, 4:].copy(),
    )


def _numbers(path: Path) -> list[list[float]]:
    """The lines' numbers, remarks and empty lines left out."""
    if path.stat().st_size > LARGEST_BYTES:
        raise BadInputError(f"{path.name}: over {LARGEST_BYTES} bytes; expected a table of measured reflectance")
    try:
        lines = path.read_text(encoding="ascii").splitlines()
        return [[float(word) for word in line.split()] for line in lines if line.strip() and line.lstrip()[0] != "#"]
    except ValueError as error:  # UnicodeDecodeError is one
        raise BadInputError(
            f"{path.name}: found text that is no number; expected a table of measured reflectance"
        ) from error


def _take(lines: list[list[float]], count: int, path: Path) -> tuple[Floats, list[list[float]]]:
    """The wavelengths, which may run over several lines, and the lines after them."""
    taken: list[float] = []
    for number, line in enumerate(lines):
        taken += line
        if len(taken) == count:
            return np.array(taken), lines[number + 1 :]
        if len(taken) > count:
            break
    raise BadInputError(f"{path.name}: found {len(taken)} wavelengths; expected {count}")


def _check(path: Path, wavelengths: Floats, table: Floats) -> None:
    polar = table[:, [0, 2]]
    if not np.all(np.isfinite(table)) or not np.all(np.isfinite(wavelengths)):
        raise BadInputError(f"{path.name}: found values that are not finite; expected measured numbers")
    if np.any(polar < 0.0) or np.any(polar > np.pi / 2):
        raise BadInputError(f"{path.name}: found polar angles beyond 0 to pi/2; expected radians above the surface")
    if np.any(np.diff(wavelengths) <= 0.0) or wavelengths[0] <= 0.0:
        raise BadInputError(f"{path.name}: found wavelengths that do not increase; expected nm in order")


def _direction(polar: Floats, azimuth: Floats) -> Floats:
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
