"""Writes docs/league.md: every lobe fitted to every measured material, after Ngan, Durand & Matusik 2005.

usage: python docs/make_league.py FOLDER        FOLDER holds Cornell's text tables (.brdf) and RGL's files (.bsdf)
RGL's are read by Mitsuba where it is installed, on the directions of the first text table. The measurements are not
part of this project; the page holds only what was found.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from toolkit.inference.directional import DirectionalFit, Metric, fit_directions
from toolkit.io.brdf_table import MeasuredTable, read_brdf_table
from toolkit.records import Floats
from toolkit.reflectance import LOBES, Cosines

HERE = Path(__file__).resolve().parent
UP = np.array([0.0, 0.0, 1.0])
STEEPEST_DEG = 75.5  # nearer to grazing the measurements of both collections are doubtful
METRICS: tuple[Metric, Metric] = ("linear", "cube-root")

Material = tuple[str, Cosines, Floats]


def materials(folder: Path) -> list[Material]:
    """Name, cosines, and BRDF times cosine (N, 3) of each."""
    tables = [read_brdf_table(path) for path in sorted(folder.glob("*.brdf"))]
    found = [_used(table.name, table, table.bands()) for table in tables]
    for path in sorted(folder.glob("*.bsdf")):
        values = _by_mitsuba(path, tables[0])
        if values is not None:
            found.append(_used(path.stem.removesuffix("_rgb"), tables[0], values))
    return found


def _used(name: str, table: MeasuredTable, brdf: Floats) -> Material:
    steep = np.cos(np.radians(STEEPEST_DEG))
    used = (table.light[:, 2] > steep) & (table.view[:, 2] > steep) & np.all(brdf >= 0.0, axis=1)
    cosines = Cosines.of(UP, table.light[used], table.view[used])
    return name, cosines, brdf[used] * cosines.n_dot_l[:, None]


def _by_mitsuba(path: Path, table: MeasuredTable) -> Floats | None:
    try:
        import mitsuba as mi
    except ImportError:
        return None
    mi.set_variant("scalar_rgb")
    bsdf, context = mi.load_dict({"type": "measured", "filename": str(path)}), mi.BSDFContext()
    values = []
    for light, view in zip(table.light, table.view, strict=True):
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = mi.Vector3f(*light)
        values.append(np.array(bsdf.eval(context, interaction, mi.Vector3f(*view))) / view[2])
    return np.array(values)


def page(found: list[Material]) -> str:
    """Both leagues in both metrics."""
    specular = [lobe for lobe in LOBES.values() if lobe.kind == "specular"]
    diffuse = [lobe for lobe in LOBES.values() if lobe.kind == "diffuse"]
    parts = [INTRODUCTION.format(count=len(found), lowest=f"{STEEPEST_DEG:g}")]
    for metric in METRICS:
        rows = {
            lobe.name: [fit_directions(lobe, LOBES["lambert"], c, y, metric=metric) for _, c, y in found]
            for lobe in specular
        }
        parts.append(f"## Specular lobes over Lambert, {metric} metric\n\n{_league(found, rows)}")
    for metric in METRICS:
        rows = {
            lobe.name: [fit_directions(LOBES["ggx"], lobe, c, y, metric=metric) for _, c, y in found]
            for lobe in diffuse
        }
        parts.append(f"## Diffuse lobes under GGX, {metric} metric\n\n{_league(found, rows)}")
    return "\n\n".join(parts) + "\n"


INTRODUCTION = """# The league of lobes on measured materials

Every registered lobe, fitted to each of {count} measured materials on the directions measured, {lowest} degrees from
the normal at most, in three bands of colour; shape shared, colours free and not negative. A figure is the rms error
over that of the material's best lobe in the table: 1 is the best. Written by `docs/make_league.py`; the measurements
themselves (Cornell's Program of Computer Graphics; RGL, EPFL) are not part of this project.

The linear metric is ruled by the few directions within the highlight, whose width the instrument's own aperture shares;
the cube root weighs the whole hemisphere more nearly as the eye does."""


def _league(found: list[Material], rows: dict[str, list[DirectionalFit]]) -> str:
    best = [min(fits[i].error for fits in rows.values()) for i in range(len(found))]
    lines = [f"| lobe | {' | '.join(name for name, _, _ in found)} | median |", "|---" * (len(found) + 2) + "|"]
    relative = {name: [fit.error / b for fit, b in zip(fits, best, strict=True)] for name, fits in rows.items()}
    for name, errors in sorted(relative.items(), key=lambda item: float(np.median(item[1]))):
        lines.append(f"| `{name}` | {' | '.join(f'{e:.2f}' for e in errors)} | {np.median(errors):.2f} |")
    lines.append(f"| rms of the best | {' | '.join(f'{b:.4f}' for b in best)} | |")
    return "\n".join(lines)


def main() -> None:
    """Read the folder, fit, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    (HERE / "league.md").write_text(page(materials(parser.parse_args().folder)), encoding="utf-8")


if __name__ == "__main__":
    main()
