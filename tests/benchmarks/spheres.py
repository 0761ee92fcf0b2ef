"""Spheres with known diffuse and specular layers, drawn without any of the project's own lobes."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SIZE_PX, RADIUS_PX, PHASE_DEG = 256, 120.0, 40.0
WHITE = (1.0, 1.0, 1.0)
WARM = (1.0, 0.8, 0.55)
HUE = (0.742, 0.31, 0.13)  # 33 degrees from white
BENCH_MATERIALS = ("red-plastic", "violet-rubber", "yellow-matte-plastic", "pink-jasper", "red-phenolic")


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """A picture without noise, and the two layers that it is the sum of; (n, n, 3) radiance."""

    name: str
    diffuse: np.ndarray
    specular: np.ndarray
    on_sphere: np.ndarray
    light_colour: np.ndarray
    clip: float = np.inf  # the level at which samples clip
    levels: int = 0  # quantised to so many

    @property
    def radiance(self) -> np.ndarray:
        return self.diffuse + self.specular


def _cosines() -> tuple[np.ndarray, ...]:
    """n.l, n.v, n.h, v.h and which pixels lie on the sphere."""
    row, column = np.mgrid[:SIZE_PX, :SIZE_PX]
    x, y = (column - (SIZE_PX - 1) / 2) / RADIUS_PX, -(row - (SIZE_PX - 1) / 2) / RADIUS_PX
    on = x * x + y * y < 1
    normal = np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], axis=-1)
    phase = np.radians(PHASE_DEG)
    light = np.array([0.8 * np.sin(phase), 0.6 * np.sin(phase), np.cos(phase)])
    half = light + np.array([0, 0, 1])
    half /= np.linalg.norm(half)
    return np.maximum(normal @ light, 0), normal[..., 2], np.clip(normal @ half, -1, 1), half[2], on


def gaussian_lobe(sigma: float) -> np.ndarray:
    """Torrance and Sparrow's highlight: Gaussian facets, V-grooves, peak 1; (n, n)."""
    nl, nv, nh, vh, on = _cosines()
    grooves = np.clip(np.minimum(1, 2 * nh * np.minimum(nl, nv) / vh), 0, None)
    return _peak_one(np.exp(-(np.arccos(nh) ** 2) / (2 * sigma**2)) * grooves, nl, nv, on)


def ggx_lobe(sigma: float) -> np.ndarray:
    """GGX facets of the same slope spread under Smith's masking, peak 1: tails that reach everywhere; (n, n)."""
    nl, nv, nh, _, on = _cosines()
    a2 = 2 * sigma**2

    def smith(c: np.ndarray) -> np.ndarray:
        return 2 / (1 + np.sqrt(1 + a2 * (1 / np.maximum(c, 1e-9) ** 2 - 1)))

    return _peak_one(smith(nl) * smith(nv) / (nh**2 * (a2 - 1) + 1) ** 2, nl, nv, on)


def _peak_one(lobe: np.ndarray, nl: np.ndarray, nv: np.ndarray, on: np.ndarray) -> np.ndarray:
    lit = on & (nl > 0) & (nv > 1e-6)
    out = np.zeros(lobe.shape)
    out[lit] = lobe[lit] / nv[lit]
    return out / out.max()


def glossy(
    name: str, lobe: np.ndarray, *, body=HUE, light=WHITE, peak: float = 0.95, veil: float = 0.0, **more
) -> Picture:
    """A Lambertian body under a highlight of height `peak`; `veil` is the radiance of an even room, mirrored."""
    nl, nv, _, _, on = _cosines()
    colour = np.array(light, float)
    room = veil * (0.04 + 0.96 * (1 - nv) ** 5) * on
    return Picture(
        name=name,
        diffuse=(nl * on)[..., None] * np.array(body, float) * colour,
        specular=(peak * lobe + room)[..., None] * colour,
        on_sphere=on,
        light_colour=colour,
        **more,
    )


def turned_from_white(degrees: float, brightness: float = 0.742) -> tuple[float, ...]:
    """A body colour so far from white, towards HUE, its largest channel at `brightness`."""
    white = np.ones(3) / np.sqrt(3)
    hue = np.array(HUE) / np.linalg.norm(HUE)
    side = hue - (hue @ white) * white
    side /= np.linalg.norm(side)
    colour = np.cos(np.radians(degrees)) * white + np.sin(np.radians(degrees)) * side
    return tuple(colour / colour.max() * brightness)


def clipped_share(picture: Picture, share: float) -> Picture:
    """The same, clipping at the level that this share of the sphere's pixels exceeds."""
    brightest = picture.radiance[picture.on_sphere].max(axis=1)
    level = float(np.quantile(brightest, 1 - share))
    fields = {f: getattr(picture, f) for f in ("name", "diffuse", "specular", "on_sphere", "light_colour")}
    return Picture(**fields, clip=level)


def cases(sigma: float) -> list[Picture]:
    """The cases of the benchmark at one roughness."""
    lobe = gaussian_lobe(sigma)
    hue = glossy("one hue", lobe)
    return [
        hue,
        glossy("near grey, 16 deg", lobe, body=turned_from_white(16)),
        glossy("near grey, 6 deg", lobe, body=turned_from_white(6)),
        glossy("grey", lobe, body=(0.742, 0.742, 0.742)),
        glossy("warm light", lobe, light=WARM),
        clipped_share(glossy("3.8 % clipped", lobe), 0.038),
        glossy("12-bit", lobe, body=tuple(0.58 * np.array(HUE)), peak=0.55, levels=4095),
        glossy("veil", lobe, veil=0.3),
        glossy("GGX tails", ggx_lobe(sigma)),
    ]


def measured(folder: Path) -> list[Picture]:
    """Spheres of measured materials, by the published fits of Low et al. (2012), f = kD/pi + F G S / (pi n.l n.v)."""
    found = json.loads((folder / "abc_params.json").read_text())
    return [_low(name, found[name]) for name in BENCH_MATERIALS]


def _low(name: str, fit: dict) -> Picture:
    nl, nv, nh, vh, on = _cosines()
    lit = on & (nl > 0) & (nv > 1e-3)
    grooves = np.clip(np.minimum(1, 2 * nh * np.minimum(nl, nv) / vh), 0, None)
    facets = np.array(fit["A"]) / (1 + fit["B"] * (1 - nh[..., None])) ** fit["C"]
    fresnel = _fresnel(vh, fit["ior"])
    specular = np.where(lit[..., None], fresnel * grooves[..., None] * facets / np.maximum(nv, 1e-3)[..., None], 0)
    diffuse = np.where(lit[..., None], np.array(fit["kD"]) * nl[..., None], 0)
    exposure = 0.7 / diffuse.max()
    light = np.ones(3)
    return Picture(
        name=name, diffuse=diffuse * exposure, specular=specular * exposure, on_sphere=on, light_colour=light, clip=1.0
    )


def _fresnel(cosine: float, ior: float) -> float:
    """Of a dielectric for unpolarised light."""
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s = (cosine - ior * inside) / (cosine + ior * inside)
    p = (inside - ior * cosine) / (inside + ior * cosine)
    return float((s * s + p * p) / 2)
