"""A whole report without a fit: a small glossy ball rendered in numpy, and posteriors drawn around its truth.

`report()` is what the outputs are made from; `hostile_report()` is the same with strings that want to break out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from toolkit.flags import Flag
from toolkit.geometry.lights import DirectionalLight
from toolkit.geometry.sphere import surface
from toolkit.inference.layers import layers_of, predict
from toolkit.radiometry.colour import camera_colour
from toolkit.records import (
    Agreement,
    Camera,
    ColourLayers,
    Diagnostics,
    Estimate,
    Fit,
    Floats,
    LinearImage,
    MaterialReport,
    Metadata,
    ModelLayers,
    Noise,
    Plane,
    Scene,
    Sphere,
)
from toolkit.reflectance import LOBES

ALBEDO = np.array([0.62, 0.27, 0.08])
STRENGTH = np.array([0.041, 0.041, 0.041])
PEDESTAL = np.array([2e-4, 2e-4, 3e-4])
IRRADIANCE = np.array([2.4, 4.4, 3.1])  # a camera's green sees most
LIGHT = DirectionalLight(
    direction=(0.45, 0.35, 0.82), direction_sd_deg=0.3, irradiance=tuple(IRRADIANCE), angular_radius_deg=0.27
)
NOISE = Noise(gain=np.full(3, 1 / 40000), read=np.full(3, 3 / 40000), source="noise_profile")
XYZ_TO_CAMERA = ((0.9020, -0.2890, -0.0715), (-0.4535, 1.2436, 0.2348), (-0.0934, 0.1919, 0.7086))  # made up, plausible
METADATA = Metadata(
    make="Synthetic",
    model="RenderCam",
    lens="Synth 50mm",
    software="fakes",
    taken="2026:01:02 03:04:05",
    exposure_s=1 / 60,
    iso=100.0,
    f_number=8.0,
    focal_length_mm=50.0,
    xyz_to_camera=XYZ_TO_CAMERA,
    as_shot_neutral=(0.55, 1.0, 0.7),
)
SHAPES: Mapping[str, tuple[str, str, float]] = {  # model -> name, unit and value of its shape
    "torrance-sparrow": ("roughness_rad", "rad", 0.12),
    "phong": ("shininess", "1", 17.5),
    "blinn-phong": ("shininess", "1", 70.0),
    "beckmann": ("alpha", "1", 0.168),
    "ggx": ("alpha", "1", 0.135),
}
CHI2 = {"torrance-sparrow": 1.003, "beckmann": 1.041, "blinn-phong": 1.19, "phong": 2.4, "ggx": 1.62}
CHAINS, DRAWS = 4, 500


def scene(width_px: int = 320, height_px: int = 240, *, radius_px: float | None = None) -> Scene:
    """A ball two thirds of the frame's height, a little off its middle, seen from afar."""
    sphere = Sphere(
        centre_px=(0.51 * width_px, 0.49 * height_px),
        radius_px=radius_px or height_px / 3,
        covariance_px2=np.diag([0.01, 0.01, 0.01]),
        source="detected",
        given=None,
    )
    return Scene(camera=Camera(), sphere=sphere, lights=(LIGHT,), light_source="given", scale="absolute")


def fit(model: str, of: Scene, rng: np.random.Generator, *, draws: int = DRAWS) -> Fit:
    """One model's fit, as if converged, its posterior drawn from Gaussians around the truth."""
    name, unit, value = SHAPES[model]
    microfacet = model not in ("phong", "blinn-phong")
    strength = STRENGTH if microfacet else STRENGTH * 2.9
    flat = [
        (name, unit, np.asarray(value), 4e-4, 1e-3),
        ("diffuse_albedo", "1", ALBEDO, 1e-3, 4e-4),
        ("specular_strength" if microfacet else "specular_albedo", "1", strength, 3e-3, 5e-3),
        ("pedestal", "image units", PEDESTAL, 0.1, 0.2),
    ]
    chains = {n: v * (1 + s * rng.standard_normal((CHAINS, draws, *v.shape))) for n, _, v, _, s in flat}
    estimates = [_estimate(n, u, v, s / 2.5, chains[n]) for n, u, v, _, s in flat]
    if microfacet:
        f0 = STRENGTH  # 17 degrees off normal incidence Schlick adds nothing
        chains["specular_f0"] = f0 * (1 + 6e-3 * rng.standard_normal((CHAINS, draws, 3)))
        estimates.insert(3, _estimate("specular_f0", "1", f0, 3e-3, chains["specular_f0"]))
    common = np.random.default_rng(7).chisquare(50, 64)  # the blocks' own noise, the same for every model
    blocks = -0.5 * (common + 50 * (CHI2[model] - 1) * rng.gamma(2, 0.5, 64))
    return Fit(
        model=model,
        variant=LOBES[model].complete({}),
        diffuse="lambert",
        status="converged",
        flags=() if model == "torrance-sparrow" else (Flag.POOR_FIT,),
        shape={name: value},
        colours={
            "diffuse_albedo": ALBEDO,
            flat[2][0]: strength,
            "pedestal": PEDESTAL,
            **({"specular_f0": STRENGTH} if microfacet else {}),
        },
        chi2_reduced=CHI2[model],
        elpd=float(blocks.sum()),
        elpd_blocks=blocks,
        parameters=tuple(estimates),
        diagnostics=Diagnostics(
            samples=CHAINS * draws, ess_min=1834.2, r_hat_max=1.004, tau_max=11.7, acceptance=0.71, seed=0
        ),
        draws=chains,
        scene=replace(
            of,
            lights=(LIGHT.model_copy(update={"direction": (0.4519, 0.3499, 0.8206), "direction_sd_deg": 0.04}),),
        ),
        nuisances={
            "light0.tilt_x_rad": (1.4e-3, 5e-4),
            "light0.tilt_y_rad": (-3e-4, 6e-4),
            "light0.nearness_per_radius": (0.001, 0.002),
            "sphere.centre_x_px": (0.011, 0.006),
            "sphere.radius_px": (-0.004, 0.008),
        },
    )


def _estimate(name: str, unit: str, mode: Floats, statistical: float, draws: Floats) -> Estimate:
    def interval(level: float) -> tuple[Any, Any]:
        low, high = np.quantile(draws, [(1 - level) / 2, (1 + level) / 2], axis=(0, 1))
        return _number(low), _number(high)

    return Estimate(
        name=name,
        unit=unit,
        estimate=_number(draws.mean((0, 1))),
        mode=_number(mode),
        sd=_number(draws.std((0, 1))),
        sd_statistical=_number(statistical * np.abs(mode)),
        interval_68=interval(0.68),
        interval_90=interval(0.90),
        posterior_to_prior=_number(np.full(np.shape(mode), 0.002)),
    )


def _number(value: Any) -> float | Floats:
    return float(value) if np.ndim(value) == 0 else np.asarray(value)


def image(of: Scene, best: Fit, rng: np.random.Generator, *, width_px: int = 320, height_px: int = 240) -> LinearImage:
    """The photograph as an RGGB mosaic with noise and a clipped, blooming core where it exceeds 1."""
    planes = []
    for channel, (x0, y0) in zip((0, 1, 1, 2), ((0, 0), (1, 0), (0, 1), (1, 1)), strict=True):
        y, x = np.mgrid[y0:height_px:2, x0:width_px:2].astype(float)
        clean = _radiance(best, x.ravel(), y.ravel())[:, channel].reshape(x.shape)
        noisy = clean + rng.standard_normal(clean.shape) * np.sqrt(NOISE.variance(clean, channel))
        planes.append(
            Plane(
                channel=channel,
                values=np.minimum(noisy, 1.0).astype(np.float32),
                flags=(noisy >= 1.0).astype(np.uint8),
                origin_px=(float(x0), float(y0)),
                step_px=2,
            )
        )
    return LinearImage(
        name="ball.dng",
        sha256="9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
        width_px=width_px,
        height_px=height_px,
        planes=tuple(planes),
        noise=NOISE,
        white=1.0,
        metadata=METADATA,
    )


def _radiance(of: Fit, x: Floats, y: Floats) -> Floats:
    seen = surface(of.scene.camera, of.scene.sphere, x, y).on_sphere[:, None]
    p = predict(of, x, y)
    return np.where(seen, p.diffuse + p.specular, 0.004 * IRRADIANCE) + p.pedestal


def layers(photograph: LinearImage, best: Fit) -> ModelLayers:
    """The best fit's pictures on the quads of the sphere's box, as the main job makes them."""
    cx, cy = best.scene.sphere.centre_px
    reach = best.scene.sphere.radius_px + 3
    rows = slice(int((cy - reach) // 2), int((cy + reach) // 2) + 1)
    columns = slice(int((cx - reach) // 2), int((cx + reach) // 2) + 1)
    quads = _quads(photograph)[rows, columns]
    origin = (2.0 * columns.start + 0.5, 2.0 * rows.start + 0.5)
    places = np.array([[-0.5, -0.5], [0.0, 0.0], [0.5, 0.5]])  # of red, both greens and blue about their quad's middle
    return layers_of(best, quads, quads < 0.999, origin_px=origin, step_px=2, places_px=places)


def _quads(photograph: LinearImage) -> Floats:
    r, g1, g2, b = (plane.values.astype(float) for plane in photograph.planes)
    return np.stack([r, (g1 + g2) / 2, b], axis=-1)


def separation(of: ModelLayers) -> ColourLayers:
    """What a perfect separation by colour would say."""
    body, light = (c / np.linalg.norm(c) for c in (ALBEDO * IRRADIANCE, IRRADIANCE))
    basis = np.stack([body, light], axis=1)
    coefficients = (of.photograph - of.pedestal) @ np.linalg.pinv(basis).T
    diffuse, specular = (coefficients[..., i : i + 1] * c for i, c in enumerate((body, light)))
    off_plane = np.linalg.norm(of.photograph - of.pedestal - diffuse - specular, axis=-1)
    return ColourLayers(
        method="dichromatic",
        body_colour=body,
        light_colour=light,
        body_covariance=np.eye(3) * 1e-7,
        light_covariance=np.eye(3) * 1e-6,
        light_source="irradiance",
        angle_deg=float(np.degrees(np.arccos(body @ light))),
        angle_sd_deg=0.08,
        cluster="plane",
        along_body=coefficients[..., 0],
        along_light=coefficients[..., 1],
        covariance=np.full((*off_plane.shape, 3), 1e-8),
        residual=off_plane,
        corner=0.8 * np.nanmax(diffuse, axis=(0, 1)),
        highlight_colour=light,
        origin_px=of.origin_px,
        step_px=of.step_px,
    )


def report(
    *, seed: int = 0, width_px: int = 320, height_px: int = 240, radius_px: float | None = None, draws: int = DRAWS
) -> MaterialReport:
    """A whole report: RGGB mosaic, five models, torrance-sparrow the best of them."""
    rng = np.random.default_rng(seed)
    of = scene(width_px, height_px, radius_px=radius_px)
    fits = tuple(fit(model, of, rng, draws=draws) for model in SHAPES)
    photograph = image(of, fits[0], rng, width_px=width_px, height_px=height_px)
    pictures = layers(photograph, fits[0])
    gaps = fits[0].elpd_blocks - fits[3].elpd_blocks
    return MaterialReport(
        image=photograph,
        scene=of,
        separation=separation(pictures),
        agreement=Agreement(preferred="shape", reason="the lobes describe the ball", difference=0.01, disagree=False),
        fits=fits,
        best=0,
        preferred=0,
        elpd_difference=(float(gaps.sum()), float(np.sqrt(len(gaps)) * gaps.std())),
        layers=pictures,
        flags=(Flag.CLIPPED,),
        colour=camera_colour(METADATA),
        seconds={"read": 0.21, "detect": 0.10, "separate": 0.30, "fit": 0.80, "sample": 1.20},
    )


HOSTILE = '<script>alert("x")</script>\'"&\x00\x1b[31m\u202e=cmd()|\ud800{{7*7}}{% raw %}]]>-->'


def hostile_report() -> MaterialReport:
    """The same report from a file whose every string wants to break out."""
    good = report()
    bad = replace(
        METADATA, make=HOSTILE, model=HOSTILE, lens=HOSTILE, software=HOSTILE, taken=HOSTILE, notes=(HOSTILE,)
    )
    worst = replace(good.fits[1], status=HOSTILE, flags=(HOSTILE,))
    return replace(
        good,
        image=replace(good.image, name="../../" + HOSTILE + ".dng", metadata=bad),
        fits=(good.fits[0], worst, *good.fits[2:]),
        flags=(HOSTILE,),
    )
