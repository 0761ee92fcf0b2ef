"""Measured complex indices n + i k of four metals over the visible, and what they reflect.

Gold, silver and copper: Johnson & Christy 1972, evaporated films at room temperature. Aluminium: Rakic 1995, critical
compilation for evaporated films. Polished and aged samples differ: two laboratories' gold differs by 0.04 of
reflectance in the blue and 0.02 in the red, silver and aluminium by less than 0.01.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.records import Floats, readonly

from .cosines import Number
from .fresnel import conductor


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Metal:
    """One metal's table; between its rows n and k are linear in the wavelength."""

    name: str
    source: str  # key in docs/bibliography.bib
    wavelength_nm: Floats  # (N,), increasing
    n: Floats  # (N,)
    k: Floats  # (N,)

    def __post_init__(self) -> None:
        readonly(self)

    def index(self, wavelength_nm: Number) -> tuple[Floats, Floats]:
        """The index n + i k at wavelengths; raises ValueError beyond the table."""
        asked = np.asarray(wavelength_nm, float)
        low, high = self.wavelength_nm[0], self.wavelength_nm[-1]
        if np.any((asked < low) | (asked > high)):
            raise ValueError(f"{self.name} at {wavelength_nm} nm; its table holds {low:g} to {high:g} nm")
        return np.interp(asked, self.wavelength_nm, self.n), np.interp(asked, self.wavelength_nm, self.k)

    def reflectance(self, wavelength_nm: Number, cosine: Number = 1.0) -> Floats:
        """Fresnel's reflectance of unpolarised light at the cosine of incidence."""
        return conductor(np.asarray(cosine), *self.index(wavelength_nm))


def _metal(name: str, source: str, rows: str) -> Metal:
    table = np.array([[float(word) for word in row.split()] for row in rows.split(",")])
    return Metal(name=name, source=source, wavelength_nm=table[:, 0].copy(), n=table[:, 1].copy(), k=table[:, 2].copy())


METALS = {
    metal.name: metal
    for metal in (
        _metal(
            "gold",
            "johnson1972",
            "397.4 1.47 1.952,413.3 1.46 1.958,430.5 1.45 1.948,450.9 1.38 1.914,471.4 1.31 1.849,495.9 1.04 1.833,"
            "520.9 0.62 2.081,548.6 0.43 2.455,582.1 0.29 2.863,616.8 0.21 3.272,659.5 0.14 3.697,704.5 0.13 4.103",
        ),
        _metal(
            "silver",
            "johnson1972",
            "397.4 0.05 2.070,413.3 0.05 2.275,430.5 0.04 2.462,450.9 0.04 2.657,471.4 0.05 2.869,495.9 0.05 3.093,"
            "520.9 0.05 3.324,548.6 0.06 3.586,582.1 0.05 3.858,616.8 0.06 4.152,659.5 0.05 4.483,704.5 0.04 4.838",
        ),
        _metal(
            "copper",
            "johnson1972",
            "397.4 1.32 2.116,413.3 1.28 2.207,430.5 1.25 2.305,450.9 1.24 2.397,471.4 1.25 2.483,495.9 1.22 2.564,"
            "520.9 1.18 2.608,548.6 1.02 2.577,582.1 0.70 2.704,616.8 0.30 3.205,659.5 0.22 3.747,704.5 0.21 4.205",
        ),
        _metal(
            "aluminium",
            "rakic1995",
            "364.66 0.39877 4.3957, 413.28 0.52135 5.0008, 442.80 0.60790 5.3676, 476.87 0.72780 5.7781,"
            "516.60 0.87340 6.2418, 563.57 1.0728 6.7839, 619.93 1.3660 7.4052, 652.25 1.5724 7.7354,"
            "688.81 1.8301 8.0601, 729.32 2.1606 8.3565",
        ),
    )
}
