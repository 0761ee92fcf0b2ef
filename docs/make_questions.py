"""Writes docs/questions: the lecture's questions about models of reflection, answered by this project's own lobes.

usage: python docs/make_questions.py
Each page has a picture (SVG) and the numbers behind it. A test makes the pages anew and compares their text.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.records import Floats
from toolkit.reflectance import LOBES, Cosines, fresnel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).resolve().parent
UP = np.array([0.0, 0.0, 1.0])
SUN_RAD = float(np.radians(0.27))

Page = tuple[str, "Figure"]


def pages() -> dict[str, Page]:
    """Every page's text and picture by name."""
    return {
        "phong-spheres": phong_spheres(),
        "three-components": three_components(),
        "grazing-view": grazing_view(),
        "off-specular-peak": off_specular_peak(),
    }


# --- how does a Phong sphere change with the light and the sharpness?


def phong_spheres() -> Page:
    """A grid of spheres, and the size of their highlights."""
    lights, exponents = (0, 30, 60, 90), (5, 20, 100, 500)
    figure, axes = _figure(len(lights), len(exponents), (7.2, 7.6))
    for row, light_deg in enumerate(lights):
        for column, n in enumerate(exponents):
            axis = axes[row][column]
            axis.imshow(_sphere(light_deg, n), cmap="gray", vmin=0.0, vmax=1.0, interpolation="bilinear")
            axis.set_axis_off()
            if row == 0:
                axis.set_title(f"n = {n}", fontsize=10)
            if column == 0:
                axis.text(
                    -0.08, 0.5, f"light {light_deg}°", transform=axis.transAxes, rotation=90, va="center", ha="right"
                )
    rows = []
    for light_deg in lights:
        for n in exponents:
            (phong_in, phong_across), (blinn_in, blinn_across) = (
                _spot("phong", n, light_deg),
                _spot("blinn-phong", 4 * n, light_deg),
            )
            rows.append(
                f"| {light_deg} | {n} | {phong_in:.1f} x {phong_across:.1f} | {blinn_in:.1f} x {blinn_across:.1f} |"
            )
    text = f"""# How does a Phong sphere change with the light and the sharpness?

![sixteen spheres](phong-spheres.svg)

Spheres under one far light, seen from far away: 0.5 (n.l) + 0.5 (r.v)^n. Down: the light goes from behind the camera to
the side. Across: the exponent n goes from 5 to 500.

The highlight sits where the normal halves the angle between light and camera: it moves by half of what the light moves.
A larger exponent makes it smaller, as 1 / sqrt(n), and no brighter: the lecture's form keeps its peak at rho_s,
whatever n is, so a sharper highlight reflects less light in all (`normalisation=energy` makes up for that).

The table gives the angles of the surface, in degrees, over which the highlight is above half of its peak: along the
plane of light and camera, and across it. Phong's grows across as the light goes to the side, since turning the normal
out of the plane turns the mirrored ray by only 2 cos(theta_d) as much. Blinn's, with four times the exponent, is the
same along the plane, and round.

| light, degrees | n | Phong, degrees | Blinn-Phong with 4 n, degrees |
|---|---|---|---|
{chr(10).join(rows)}
"""
    return text, figure


def _sphere(light_deg: float, n: float) -> Floats:
    edge = (np.arange(96) + 0.5) / 48.0 - 1.0
    x, y = np.meshgrid(edge, -edge)
    z2 = 1.0 - x * x - y * y
    normal = np.stack([x, y, np.sqrt(np.maximum(z2, 0.0))], axis=-1)
    cosines = Cosines.of(normal, _at(light_deg), UP)
    shade = 0.5 * np.pi * LOBES["lambert"].value(cosines, ()) + 0.5 * LOBES["phong"].value(cosines, (float(n),))
    return np.asarray(np.where(z2 > 0.0, np.minimum(shade, 1.0) ** (1 / 2.2), 1.0))


def _spot(name: str, n: float, light_deg: float) -> tuple[float, float]:
    """Full widths at half of the highlight, in degrees of the normal, along the plane of light and view and across."""
    offset = np.radians(np.arange(-60.0, 60.001, 0.01))
    centre = np.radians(light_deg) / 2
    along = np.stack([np.sin(centre + offset), np.zeros_like(offset), np.cos(centre + offset)], axis=-1)
    middle, side = np.array([np.sin(centre), 0.0, np.cos(centre)]), np.array([0.0, 1.0, 0.0])
    across = np.cos(offset)[:, None] * middle + np.sin(offset)[:, None] * side
    widths = []
    for normal in (along, across):
        value = LOBES[name].value(Cosines.of(normal, _at(light_deg), UP), (float(n),))
        widths.append(0.01 * np.count_nonzero(value > 0.5 * value.max()))
    return widths[0], widths[1]


# --- what do diffuse lobe, specular lobe and spike do as light or camera moves?

SIGMA, SPIKE_SHARE, INDEX, ALBEDO = 0.12, 0.02, 1.5, 0.4


def three_components() -> Page:
    """Radiance of the three components, the camera moving and the light moving."""
    angle = np.arange(-89.9, 89.95, 0.02)
    moves = {"camera": _components(_at(30.0), _at(-angle)), "light": _components(_at(angle), _at(-30.0))}
    figure, axes = _figure(1, 2, (8.4, 3.6))
    for axis, (moving, parts) in zip(axes[0], moves.items(), strict=True):
        for name, value in parts.items():
            axis.semilogy(angle, np.maximum(value, 1e-9), label=name, linewidth=1.3)
        axis.set(xlabel=f"angle of the {moving}, degrees", ylim=(1e-3, 3e1), xlim=(-90, 90), xticks=range(-90, 91, 30))
        axis.set_title(f"the {moving} moves", fontsize=10)
    axes[0][0].set_ylabel("radiance under irradiance 1, sr$^{-1}$")
    axes[0][0].legend(fontsize=8)
    rows = []
    for moving, parts in moves.items():
        for name, value in parts.items():
            rows.append(f"| {moving} | {name} | {_measured(angle, value)} |")
    text = f"""# What do the three components do as the light moves, and as the camera moves?

![three components](three-components.svg)

A surface of glossy plastic in the plane of incidence: a diffuse lobe (Lambert, albedo {ALBEDO:g}), a specular lobe
(Torrance-Sparrow, facets spread by {SIGMA:g} rad) and a specular spike (a mirror showing a lamp of 0.27 degrees radius
through a blur of 0.3 degrees, with {100 * SPIKE_SHARE:g} % of what a smooth surface would send there); both times
Fresnel's factor for an index of {INDEX:g}. On the left the light stays at 30 degrees on one side and the camera goes
from grazing to grazing; on the right the camera stays and the light goes. Angles count towards the mirror direction.

- The **diffuse lobe** is the same wherever the camera is. As the light moves it follows the cosine.
- The **specular lobe** peaks near the mirror direction but beyond it, and more so as the camera moves (1 / (n.v) grows)
  than as the light moves.
- The **spike** stays exactly in the mirror direction and is as wide as lamp and blur.
- Moving the normal instead, as a sphere does within one photograph, moves both at once: everything is met at half the
  angle.

The last column is the radiance at 75 degrees over that at 0.

| moving | component | peak at, degrees | width at half, degrees | peak, sr^-1 | 75 over 0 |
|---|---|---|---|---|---|
{chr(10).join(rows)}
"""
    return text, figure


def _measured(angle: Floats, value: Floats) -> str:
    """Peak's angle, width at half, height, and the radiance at 75 degrees over that at 0, as cells of a table."""
    peak = "everywhere" if np.ptp(value) < 1e-9 else f"{angle[np.argmax(value)]:.1f}"
    width = 0.02 * np.count_nonzero(value > 0.5 * value.max())
    low, high = (value[np.searchsorted(angle, at)] for at in (0.0, 75.0))
    ratio = f"{high / low:.3g}" if low > 1e-9 else "0 over 0"
    return f"{peak} | {width:.1f} | {value.max():.3f} | {ratio}"


def _components(light: Floats, view: Floats) -> dict[str, Floats]:
    cosines = Cosines.of(UP, light, view, source_radius_rad=SUN_RAD)
    f = fresnel.dielectric(cosines.l_dot_h, INDEX)
    return {
        "diffuse lobe": ALBEDO * LOBES["lambert"].value(cosines, ()),
        "specular lobe": f * LOBES["torrance-sparrow"].value(cosines, (SIGMA,)),
        "specular spike": SPIKE_SHARE * f * LOBES["mirror"].value(cosines, (float(np.radians(0.3)),)),
    }


# --- does the expression blow up at grazing view?


def grazing_view() -> Page:
    """The lobe down to grazing, with and without masking, and with the light grazing as well."""
    n_dot_v = 10.0 ** -np.arange(0.25, 7.01, 0.25)
    view = np.stack([-np.sqrt(1.0 - n_dot_v**2), np.zeros_like(n_dot_v), n_dot_v], axis=-1)
    fixed, both = Cosines.of(UP, _at(60.0), view), Cosines.of(UP, view * [-1.0, -1.0, 1.0], view)
    sigma, alpha = 0.2, 0.2 * np.sqrt(2.0)
    curves = {
        "Torrance-Sparrow, light at 60°": LOBES["torrance-sparrow"].value(fixed, (sigma,)),
        "GGX with Smith's G, light at 60°": LOBES["ggx"].value(fixed, (alpha,)),
        "without G, light at 60°": _without_masking(fixed, sigma),
        "Ward 1992, light at 60°": LOBES["ward"].value(fixed, (alpha,)),
        "Torrance-Sparrow, both grazing": LOBES["torrance-sparrow"].value(both, (sigma,)),
        "GGX with Smith's G, both grazing": LOBES["ggx"].value(both, (alpha,)),
    }
    figure, axes = _figure(1, 1, (6.4, 4.2))
    for name, value in curves.items():
        axes[0][0].loglog(n_dot_v, value, label=name, linewidth=1.3, linestyle="--" if "both" in name else "-")
    axes[0][0].set(xlabel="n.v, the cosine of the view", ylabel="lobe, sr$^{-1}$", xlim=(1.0, 1e-7), ylim=(1e-3, 1e7))
    axes[0][0].legend(fontsize=8)
    shown = [int(np.argmin(np.abs(n_dot_v - 10.0**-k))) for k in (1, 2, 4, 6)]
    rows = [f"| {name} | " + " | ".join(f"{value[i]:.3g}" for i in shown) + " |" for name, value in curves.items()]
    text = f"""# Does the expression blow up at grazing view?

![the lobe against the cosine of the view](grazing-view.svg)

The lecture's closing form divides by cos(theta_r), which goes to 0 as the camera grazes the surface. **No, not under a
fixed light:** G, the share of facets that are seen, falls as fast as cos(theta_r). With V-grooves the quotient becomes
2 (n.h) / (v.h) times D / 4, a finite number; with Smith's G it is finite as well. Leave G out and it does blow up, as
1 / (n.v). Ward's lobe of 1992, which has no G, does so as 1 / sqrt(n.v).

**Yes, with V-grooves when light and camera graze together:** both of G's terms then share one cosine, and 1 / (n.v) is
left over. That is no error of the formula: a grazing light leaves within an ever smaller solid angle, and all of it
together stays below what came in. Smith's G, which hides facets from the light and from the camera separately, keeps
even this bounded.

In the plane of incidence on the mirror's side, facets spread by 0.2 rad (alpha = 0.28), F left out:

| sr^-1 at n.v = | 0.1 | 0.01 | 1e-4 | 1e-6 |
|---|---|---|---|---|
{chr(10).join(rows)}
"""
    return text, figure


def _without_masking(cosines: Cosines, sigma: float) -> Floats:
    from toolkit.reflectance.distributions import gaussian

    return np.asarray(gaussian(cosines, sigma) / (4.0 * cosines.n_dot_v))


# --- where does the off-specular peak stand?


def off_specular_peak() -> Page:
    """The angle of the brightest view against the light's, by roughness."""
    light = np.arange(0.0, 86.0, 1.0)
    figure, axes = _figure(1, 1, (6.0, 4.4))
    for sigma in (0.02, 0.05, 0.1, 0.2):
        peaks = [_peak("torrance-sparrow", sigma, angle) for angle in light]
        axes[0][0].plot(light, np.array(peaks) - light, label=f"$\\sigma$ = {sigma:g} rad", linewidth=1.3)
    axes[0][0].set(
        xlabel="angle of the light, degrees", ylabel="peak beyond the mirror direction, degrees", xlim=(0, 85)
    )
    axes[0][0].legend(fontsize=8)
    rows = []
    for sigma in (0.05, 0.1, 0.2):
        for angle in (30.0, 45.0, 60.0):
            alpha = float(np.sqrt(2.0) * sigma)
            cells = [_peak("torrance-sparrow", sigma, angle), _peak("torrance-sparrow", sigma, angle, INDEX)]
            cells += [_peak("beckmann", alpha, angle), _peak("ggx", alpha, angle)]
            rows.append(f"| {sigma:g} | {angle:g} | " + " | ".join(f"{cell:.1f}" for cell in cells) + " |")
    text = f"""# Where does the off-specular peak stand?

![off-specular peak](off-specular-peak.svg)

A rough surface is brightest not in the mirror direction but beyond it, the more so the rougher it is and the flatter
the light: D alone would peak in the mirror direction, but it is divided by cos(theta_r), which falls towards grazing,
so the product peaks later. To first order the shift is 4 sigma^2 tan(theta) radians. It ends where G sets in: at
0.2 rad and 60 degrees the peak stands on the kink of G. This is what Torrance and Sparrow set out to explain in 1967.

View angle of the peak in degrees, in the plane of incidence (the mirror direction is the light's own angle). Beckmann
and GGX with alpha = sqrt(2) sigma and Smith's G; 90.0 says that the lobe still rises at the horizon:

| sigma, rad | light | V-groove, F = 1 | with F of n = {INDEX:g} | Beckmann, F = 1 | GGX, F = 1 |
|---|---|---|---|---|---|
{chr(10).join(rows)}
"""
    return text, figure


def _peak(name: str, width: float, light_deg: float, index: float | None = None) -> float:
    view_deg = np.arange(0.0, 90.0, 0.02)
    cosines = Cosines.of(UP, _at(light_deg), _at(-view_deg))
    value = LOBES[name].value(cosines, (width,))
    if index is not None:
        value = value * fresnel.dielectric(cosines.l_dot_h, index)
    return float(view_deg[np.argmax(value)])


def _at(angle_deg: Floats | float) -> Floats:
    """Directions in the plane of incidence; positive angles on the light's side."""
    angle = np.radians(np.asarray(angle_deg, float))
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[list]]:  # type: ignore[type-arg]
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, [list(row) for row in figure.subplots(rows, columns, squeeze=False)]


def main() -> None:
    """Write every page and its picture; the same bytes every time."""
    import matplotlib as mpl

    folder = HERE / "questions"
    folder.mkdir(exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "questions", "image.composite_image": False}):
        for name, (text, figure) in pages().items():
            (folder / f"{name}.md").write_text(text, encoding="utf-8")
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})


if __name__ == "__main__":
    main()
