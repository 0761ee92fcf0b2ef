"""A photograph of known truth in one call: render, expose, write, and say what is true of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.io.dng import write_dng
from toolkit.records import Camera, Floats, Noise, Scene

from . import camera as cam
from .files import write_exr, write_png
from .materials import Material
from .render import Render, render
from .scenes import exposed, write_scene_toml
from .shade import highlight_normal, specular_colour

Format = Literal["dng", "exr", "png"]
_COMMENT = "What is known of the photograph beside this file: irradiance and noise in the image's units."
_PX_PER_MM = 166.7  # 6 micrometre pixels: turns the focal length into the millimetres of the EXIF


def render_photograph(
    scene: Scene,
    material: Material,
    noise: Noise | None,
    *,
    width_px: int,
    height_px: int,
    format: Format,  # noqa: A002  # the word of the scene file
    exposure: float | None,
    seed: int,
    path: str | Path,
    highlight: float = 0.8,
    background: Floats | float = 0.0,
    pedestal: Floats | float = 0.0,
    blur_sd_px: float = 0.0,
    supersample: int = 8,
    sensor: cam.Sensor | None = None,
    sidecar: bool = True,
) -> dict[str, Any]:
    """Photograph a sphere to `path`, write its scene file `path` + ".toml" beside it, and return the truth.

    `exposure` is image units per radiance; None puts the brightest pixel at `highlight` of saturation. `noise` is
    in image units; None is a good camera's. `background` and `pedestal` are radiances before the exposure. The
    scene file holds the irradiance in image units and the noise with the rounding's; truth["parameters"] bears the
    names of a result. A DNG saturates at 1, a PNG at 0 and 1, an EXR nowhere.
    """
    picture = render(
        scene,
        material,
        width_px=width_px,
        height_px=height_px,
        supersample=supersample,
        background=background,
        pedestal=pedestal,
    )
    if blur_sd_px > 0.0:
        picture = cam.blurred(picture, sd_px=blur_sd_px)
    factor = exposure if exposure is not None else cam.exposure_for(picture, highlight=highlight)
    return photograph(
        picture,
        scene,
        material,
        noise,
        format=format,
        exposure=factor,
        seed=seed,
        path=path,
        sensor=sensor,
        sidecar=sidecar,
    )


def photograph(
    picture: Render,
    scene: Scene,
    material: Material,
    noise: Noise | None,
    *,
    format: Format,  # noqa: A002  # the word of the scene file
    exposure: float,
    seed: int,
    path: str | Path,
    sensor: cam.Sensor | None = None,
    sidecar: bool = True,
) -> dict[str, Any]:
    """Photograph a picture that is there already; all else as `render_photograph`."""
    sensor, noise = sensor or cam.Sensor(), noise or cam.GOOD_CAMERA
    steps = {"dng": sensor.step, "png": 1.0 / 65535.0, "exr": 0.0}
    rounded, seen = cam.with_rounding(noise, steps[format]), exposed(scene, exposure)
    rng = np.random.default_rng(seed)
    if format == "dng":
        samples = cam.mosaic(picture, exposure=exposure, noise=noise, sensor=sensor, rng=rng)
        write_raw(Path(path), samples, noise, sensor, scene.camera)
        clipped = int(np.count_nonzero(samples == sensor.white_dn))
    else:
        clipped = _write_rgb(Path(path), picture, exposure, noise, format, rng)
    if sidecar:
        write_scene_toml(Path(f"{path}.toml"), seen, rounded, comment=_COMMENT)
    return truth(seen, material, rounded) | {"exposure": exposure, "seed": seed, "clipped": clipped}


def write_raw(path: Path, samples: NDArray[np.uint16], noise: Noise, sensor: cam.Sensor, camera: Camera) -> None:
    """Write a mosaic as the DNG that the sensor and its camera would; `noise` goes into its NoiseProfile."""
    known = camera.projection == "perspective" and camera.focal_length_px is not None
    write_dng(
        path,
        samples,
        cfa=sensor.cfa,
        black=sensor.black_dn,
        white=sensor.white_dn,
        noise_profile=cam.noise_profile(cam.with_rounding(noise, sensor.step)),
        xyz_to_camera=sensor.xyz_to_camera,
        as_shot_neutral=sensor.as_shot_neutral,
        exposure_s=1 / 60,
        iso=100,
        f_number=16.0,
        focal_length_mm=(camera.focal_length_px or 0.0) / _PX_PER_MM if known else 85.0,
        focal_plane_px_per_mm=_PX_PER_MM if known else None,
    )


def _write_rgb(
    path: Path, picture: Render, exposure: float, noise: Noise, kind: Format, rng: np.random.Generator
) -> int:
    """Write a picture of three full channels; returns how many samples are clipped."""
    signal = exposure * picture.radiance()
    channels = [cam.expose(signal[..., c], gain=noise.gain[c], read=noise.read[c], rng=rng) for c in range(3)]
    noisy = np.stack(channels, axis=-1)
    if kind == "exr":
        write_exr(path, noisy)
        return 0
    codes = np.rint(np.clip(noisy, 0.0, 1.0) * 65535.0).astype(np.uint16)
    write_png(path, codes)
    return int(np.count_nonzero((codes == 0) | (codes == 65535)))


def truth(scene: Scene, material: Material, noise: Noise) -> dict[str, Any]:
    """What a fit of the photograph should find: parameters by a result's names, and what it was given."""
    return {
        "model": material.model,
        "variant": _variant(material),
        "diffuse": material.diffuse,
        "parameters": dict(material.shape) | _colours(scene, material),
        "noise": {"gain": noise.gain.tolist(), "read": noise.read.tolist()},
        "scale": scene.scale,
        "irradiance": [list(light.irradiance or (1.0, 1.0, 1.0)) for light in scene.lights],
    }


def _variant(material: Material) -> dict[str, str]:
    """The options that a fit would need; a refractive index reflects by Fresnel's own equations, whatever is asked."""
    exact = {"fresnel": "dielectric"} if "specular_index" in material.colours else {}
    return material.lobes[1].complete({**material.variant, **exact})


def _colours(scene: Scene, material: Material) -> dict[str, list[float]]:
    """Colours by a result's names; `specular_strength` is F in the middle of the first light's highlight."""
    colours = {key: value.tolist() for key, value in material.colours.items()}
    if "specular_albedo" not in colours and "specular_strength" not in colours:
        normal = highlight_normal(scene, scene.lights[0])
        cosine = scene.lights[0].at(normal[None])[0][0] @ normal
        colours["specular_strength"] = specular_colour(material, np.asarray(cosine)).tolist()
    return colours
