"""Whole photographs: what is written is what was rendered, and the scene file beside it is true."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from synthetic.materials import material
from synthetic.photograph import render_photograph
from synthetic.render import render
from synthetic.scenes import direction, sphere_in
from toolkit.geometry.lights import DirectionalLight, PointLight
from toolkit.records import Noise

GLOSSY = material("torrance-sparrow", {"roughness_rad": 0.15, "diffuse_albedo": (0.6, 0.2, 0.1), "specular_f0": 0.05})
NOISE = Noise(gain=np.full(3, 1e-4), read=np.full(3, 1e-3), source="given")
LAMP = DirectionalLight(direction=direction(40.0, 70.0), irradiance=(1.0, 0.9, 0.8), direction_sd_deg=0.2)
WIDTH, HEIGHT = 120, 90
SCENE = sphere_in(WIDTH, HEIGHT, radius_px=35.0, lights=[LAMP], offset_px=(2.3, 1.6))


def take(path: Path, **changed: object) -> dict:
    options: dict = {"format": path.suffix[1:], "exposure": None, "seed": 3, "width_px": WIDTH, "height_px": HEIGHT}
    scene = changed.pop("scene", SCENE)
    return render_photograph(scene, GLOSSY, NOISE, path=path, **(options | changed))


def read(path: Path) -> np.ndarray:
    """Samples in image units: (H, W) of a mosaic, else (H, W, 3)."""
    if path.suffix == ".dng":
        import rawpy

        with rawpy.imread(str(path)) as raw:
            black = np.array(raw.black_level_per_channel)[raw.raw_colors_visible]
            return (raw.raw_image_visible - black) / (raw.white_level - black)
    if path.suffix == ".exr":
        import OpenEXR

        return OpenEXR.File(str(path)).channels()["RGB"].pixels
    import cv2

    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1] / 65535


@pytest.mark.parametrize("name", ["a.dng", "a.exr", "a.png"])
def test_the_file_holds_the_picture_within_its_noise(tmp_path: Path, name: str) -> None:
    """Read by another program, the samples' residuals from the noiseless picture are the noise of the scene file."""
    told = take(tmp_path / name, pedestal=0.02)
    found = read(tmp_path / name)
    shown = told["exposure"] * render(SCENE, GLOSSY, width_px=WIDTH, height_px=HEIGHT, pedestal=0.02).radiance()
    if found.ndim == 2:
        rows, columns = np.indices(found.shape)
        shown = np.take_along_axis(shown, ((rows % 2) + (columns % 2))[..., None], axis=2)[..., 0]  # RGGB
    noise = tomllib.loads((tmp_path / f"{name}.toml").read_text())["noise"]
    z = (found - shown) / np.sqrt(noise["gain"][0] * shown + noise["read"][0] ** 2)
    assert shown.max() == pytest.approx(0.8, rel=0.05)
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs(z.var() - 1.0) < 4 * np.sqrt(2 / z.size)
    assert told["clipped"] == 0


def test_the_scene_file_is_the_scene_in_the_photographs_units(tmp_path: Path) -> None:
    """Irradiance carries the exposure; sphere, camera and light stand as they were given."""
    told = take(tmp_path / "a.dng", exposure=2.5)
    found = tomllib.loads((tmp_path / "a.dng.toml").read_text())
    assert found["sphere"] == {
        "centre_px": [61.8, 46.1],
        "radius_px": 35.0,
        "centre_sd_px": 0.1,
        "radius_sd_px": 0.1,
    }
    assert found["camera"] == {"projection": "orthographic"}
    assert found["light"][0]["irradiance"] == pytest.approx([2.5, 2.25, 2.0])
    assert found["light"][0]["direction_sd_deg"] == 0.2
    np.testing.assert_array_equal(found["light"][0]["direction"], LAMP.direction)
    assert told["irradiance"] == [found["light"][0]["irradiance"]]


def test_the_truth_names_a_results_parameters(tmp_path: Path) -> None:
    """F at the highlight's theta_d is there beside F0; half of 40 degrees hardly adds to it, half of 140 does."""
    told = take(tmp_path / "a.dng", sidecar=False)["parameters"]
    assert set(told) == {"roughness_rad", "diffuse_albedo", "specular_f0", "specular_strength"}
    assert told["specular_strength"][0] == pytest.approx(0.05 + 0.95 * (1 - np.cos(np.radians(20))) ** 5)
    grazing = sphere_in(WIDTH, HEIGHT, radius_px=35.0, lights=[DirectionalLight(direction=direction(140.0))])
    told = take(tmp_path / "b.dng", scene=grazing, sidecar=False)["parameters"]
    assert told["specular_strength"][0] == pytest.approx(0.05 + 0.95 * (1 - np.cos(np.radians(70))) ** 5)
    assert not (tmp_path / "a.dng.toml").exists()


def test_an_overexposed_highlight_is_clipped_and_counted(tmp_path: Path) -> None:
    """At four times the exposure that fits, samples stand at the white level and none above."""
    fitting = take(tmp_path / "a.dng")
    told = take(tmp_path / "b.dng", exposure=4 * fitting["exposure"])
    found = read(tmp_path / "b.dng")
    assert told["clipped"] == np.count_nonzero(found == 1.0) > 20
    assert found.max() == 1.0


def test_a_perspective_dng_tells_its_focal_length_in_its_exif(tmp_path: Path) -> None:
    """Focal length times pixels per millimetre is the camera's focal length in pixels."""
    import exifread

    scene = sphere_in(WIDTH, HEIGHT, radius_px=35.0, focal_length_px=900.0, lights=[PointLight(position=(2, 3, 6))])
    take(tmp_path / "a.dng", scene=scene)
    with (tmp_path / "a.dng").open("rb") as file:
        tags = exifread.process_file(file, details=False)
    focal_mm, per_cm = (float(tags[f"EXIF {n}"].values[0]) for n in ("FocalLength", "FocalPlaneXResolution"))
    assert focal_mm * per_cm / 10 == pytest.approx(900.0, rel=1e-5)
    found = tomllib.loads((tmp_path / "a.dng.toml").read_text())
    assert found["camera"]["focal_length_px"] == 900.0
    assert found["light"][0]["position"] == [2.0, 3.0, 6.0]


@pytest.mark.parametrize("name", ["a.dng", "a.exr", "a.png"])
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, name: str) -> None:
    """Photograph and scene file repeat to the byte; another seed changes the photograph alone."""
    for folder, seed in (("one", 1), ("two", 1), ("three", 2)):
        (tmp_path / folder).mkdir()
        take(tmp_path / folder / name, seed=seed)
    one, two, three = ((tmp_path / folder / name).read_bytes() for folder in ("one", "two", "three"))
    assert one == two != three
    assert len({(tmp_path / folder / f"{name}.toml").read_bytes() for folder in ("one", "two", "three")}) == 1
    assert [p.name for p in sorted((tmp_path / "one").iterdir())] == [name, f"{name}.toml"]
